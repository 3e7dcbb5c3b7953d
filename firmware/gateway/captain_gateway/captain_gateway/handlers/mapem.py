"""Topology of intersections: TS 103 301."""

from .kind import Kind

MAPEM = Kind(
    name="mapem",
    editions=("mapem-2.1.1",),
    position=(("map.intersections[0].refPoint.lat", "map.intersections[0].refPoint.long"),),
    key=("map.intersections[0].id.region", "map.intersections[0].id.id"),
)
