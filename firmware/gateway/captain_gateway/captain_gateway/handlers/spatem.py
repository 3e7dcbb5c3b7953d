"""Signal phases of intersections: TS 103 301."""

from .kind import Kind

SPATEM = Kind(
    name="spatem",
    editions=("spatem-2.1.1", "spatem-2.2.1"),
    key=("spat.intersections[0].id.region", "spat.intersections[0].id.id"),
)
