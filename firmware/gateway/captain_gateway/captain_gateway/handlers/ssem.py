"""Answers of traffic lights: TS 103 301."""

from .kind import Kind

SSEM = Kind(name="ssem", editions=("ssem-2.1.1",))
