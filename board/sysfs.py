"""Attributes of sysfs: one value a file, which may be gone at the next look."""

import os
from pathlib import Path

PAGE = 4096  # octets: no value is longer


def text(path: Path) -> str:
    """A value without its line's end. What a device says of itself may hold anything: what does not print is left out.

    Raises OSError: what it is of is gone, or answers no more.
    """
    # Not read_bytes(): that is None where a driver has no value yet (EAGAIN of tmp102, 35 ms after it was bound).
    descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    try:
        octets = os.read(descriptor, PAGE)
    finally:
        os.close(descriptor)
    return "".join(filter(str.isprintable, octets.decode("utf-8", "replace").strip()))


def optional(path: Path) -> str:
    """The same, empty where there is none."""
    try:
        return text(path)
    except OSError:
        return ""


def switch(path: Path, is_on: bool) -> None:
    """Write 1 or 0, in one write() as sysfs wants it. Raises OSError with what the kernel refuses."""
    descriptor = os.open(path, os.O_WRONLY | os.O_TRUNC | os.O_CLOEXEC)
    try:
        os.write(descriptor, b"1" if is_on else b"0")
    finally:
        os.close(descriptor)
