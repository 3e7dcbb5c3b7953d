"""Cooperative awareness: EN 302 637-2 as `cam`, TS 103 900 as `cam_ts`, EN 302 637-2 V1.3.2 as `cam_v1`."""

from .kind import Kind, place

CAM = Kind(
    name="cam",
    editions=("cam-1.4.1", "cam-2.3.1", "cam-2.1.1", "cam-1.3.2"),
    position=(place("cam.camParameters.basicContainer.referencePosition"),),
    generated=("cam.generationDeltaTime",),
    clock="delta",
)
CAM_TS = CAM._replace(name="cam_ts", editions=("cam-2.1.1", "cam-2.3.1", "cam-1.4.1"), is_usual=False)
# V1.3.2 has protocolVersion 1. Its CurvatureValue has another unit and more bits than in later editions.
CAM_V1 = CAM._replace(name="cam_v1", editions=("cam-1.3.2", "cam-1.4.1", "cam-2.3.1", "cam-2.1.1"), is_usual=False)
