"""Boot counters of the running box, at libubootenv's configured place."""

import os
from pathlib import Path

from board.runtime import boot_counters
from board.runtime.boot_counters import State
from board.runtime.errors import StationError

CONFIGURATION = Path("/etc/fw_env.config")  # one line per copy: device, offset, size


def read(configuration: Path = CONFIGURATION) -> State:
    """Return the counters, or a new card's if no copy is valid. Raises StationError if they cannot be read."""
    copies = []
    try:
        for line in configuration.read_text().splitlines():
            words = line.split()
            if len(words) == 3 and not line.startswith("#"):
                copies.append(_octets(words[0], int(words[1], 16), int(words[2], 16)))
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or str(error)
        raise StationError(f"boot counters: cannot be read: {why}", "ask as operator, or as root") from error
    return boot_counters.newest(copies) or State()


def _octets(path: str, offset: int, size: int) -> bytes:
    device = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    try:
        return os.pread(device, size, offset)
    finally:
        os.close(device)
