"""Collective perception: TS 103 324 as `cpm`, the older TR 103 562 as `cpm_tr`."""

from .kind import Kind, place

CPM = Kind(
    name="cpm",
    editions=("cpm-2.1.1",),
    position=(place("payload.managementContainer.referencePosition"),),
    generated=("payload.managementContainer.referenceTime",),
    clock="its",
)
CPM_TR = Kind(
    name="cpm_tr",
    editions=("cpm-tr-2.1.1",),
    position=(place("cpm.cpmParameters.managementContainer.referencePosition"),),
    generated=("cpm.generationDeltaTime",),
    clock="delta",
    is_usual=False,
)
