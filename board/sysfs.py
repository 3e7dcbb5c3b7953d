"""Attributes of sysfs: one value per file, which may disappear."""

import os
from pathlib import Path

PAGE = 4096  # octets; no value is longer


def text(path: Path) -> str:
    """Return a value without line end and unprintable characters, which texts from a device may contain.

    Raises OSError if the device is gone or does not answer.
    """
    # read_bytes() is not used: it returns None while a driver has no value (EAGAIN of tmp102, for 35 ms after binding).
    descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    try:
        octets = os.read(descriptor, PAGE)
    finally:
        os.close(descriptor)
    return "".join(filter(str.isprintable, octets.decode("utf-8", "replace").strip()))


def optional(path: Path) -> str:
    """Return a value as text() does; empty if it cannot be read."""
    try:
        return text(path)
    except OSError:
        return ""


def switch(path: Path, is_on: bool) -> None:
    """Write 1 or 0 in a single write(), as sysfs requires. Raises OSError if the kernel refuses."""
    descriptor = os.open(path, os.O_WRONLY | os.O_TRUNC | os.O_CLOEXEC)
    try:
        os.write(descriptor, b"1" if is_on else b"0")
    finally:
        os.close(descriptor)
