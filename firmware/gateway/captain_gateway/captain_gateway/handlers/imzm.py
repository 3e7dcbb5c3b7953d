"""Interference management zones, in which a station's radio must be quiet: TS 103 724."""

from .kind import Kind

IMZM = Kind(name="imzm", editions=("imzm-2.1.1",))
