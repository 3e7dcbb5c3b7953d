"""Vulnerable road users: TS 103 300-3."""

from .kind import Kind, place

# The package that others have, etsi_its_vam_ts_msgs, is that of 2.1.1; 2.3.1 has the same octets where both have
# a field.
VAM = Kind(
    name="vam",
    editions=("vam-2.1.1", "vam-2.3.1", "vam-1"),
    position=(place("vam.vamParameters.basicContainer.referencePosition"),),
    generated=("vam.generationDeltaTime",),
    clock="delta",
)
