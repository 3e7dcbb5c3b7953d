"""Cooperative awareness: EN 302 637-2 as `cam`, TS 103 900 as `cam_ts`."""

from .kind import Kind, place

CAM = Kind(
    name="cam",
    editions=("cam-1.4.1", "cam-2.3.1", "cam-2.1.1"),
    position=(place("cam.camParameters.basicContainer.referencePosition"),),
    generated=("cam.generationDeltaTime",),
    clock="delta",
)
CAM_TS = CAM._replace(name="cam_ts", editions=("cam-2.1.1", "cam-2.3.1", "cam-1.4.1"), is_usual=False)
