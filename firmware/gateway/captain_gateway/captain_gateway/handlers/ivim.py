"""Road signs and the stretch of road where they apply (IVIM): TS 103 301."""

from .kind import Kind, place

IVIM = Kind(
    name="ivim",
    editions=("ivim-2.1.1", "ivim-2.2.1"),
    position=(place("ivi.optional[0].glc.referencePosition"),),
    generated=("ivi.mandatory.timeStamp",),
    clock="its",
    key=("ivi.mandatory.serviceProviderId.providerIdentifier", "ivi.mandatory.iviIdentificationNumber"),
)
