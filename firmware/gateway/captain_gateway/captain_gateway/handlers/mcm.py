"""Manoeuvre coordination, experimental."""

from .kind import Kind

MCM = Kind(name="mcm", editions=("mcm-1",), is_usual=False)
