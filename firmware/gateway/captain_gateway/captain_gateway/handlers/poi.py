"""Points of interest: TS 103 916."""

from .kind import Kind

POI = Kind(name="poi", editions=("poi-2.1.1",))
