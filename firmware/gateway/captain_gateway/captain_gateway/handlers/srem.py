"""Requests to traffic lights: TS 103 301."""

from .kind import Kind

SREM = Kind(
    name="srem",
    editions=("srem-2.1.1",),
    position=(("srm.requestor.position.position.lat", "srm.requestor.position.position.long"),),
)
