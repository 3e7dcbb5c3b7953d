"""Vulnerable road users: TS 103 300-3."""

from .kind import Kind, place

# The default is 2.1.1, because the common package etsi_its_vam_ts_msgs is of that edition. 2.3.1 encodes the fields
# that both have to the same octets.
VAM = Kind(
    name="vam",
    editions=("vam-2.1.1", "vam-2.3.1", "vam-1"),
    position=(place("vam.vamParameters.basicContainer.referencePosition"),),
    generated=("vam.generationDeltaTime",),
    clock="delta",
)
