"""Corrections for GNSS receivers: TS 103 301."""

from .kind import Kind

RTCMEM = Kind(
    name="rtcmem",
    editions=("rtcmem-2.1.1",),
    position=(("rtcmc.anchorPoint.lat", "rtcmc.anchorPoint.long"),),
)
