"""The program mosquitto: where it is, and started so that it ends with who started it."""

import os
import shutil
import signal
import subprocess
from pathlib import Path
from typing import IO

from board.child import die_with_parent
from board.errors import StationError


def program() -> str:
    """Its path. Raises StationError where it is not installed."""
    found = shutil.which("mosquitto", path=os.pathsep.join((os.environ.get("PATH", os.defpath), "/usr/sbin")))
    if found is None:
        raise StationError("the program mosquitto is missing", "install the package mosquitto")
    return found


def launch(path: str, file: Path, said: IO[bytes] | int, number: int = signal.SIGTERM) -> "subprocess.Popen[bytes]":
    """Start it with a configuration, its log into said. number: the signal that it gets when this process ends."""
    return subprocess.Popen(
        [path, "-c", str(file)],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=said,
        start_new_session=True,
        preexec_fn=die_with_parent(number),  # noqa: PLW1509 (no thread of ours holds a lock)
    )
