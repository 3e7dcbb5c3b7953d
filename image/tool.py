"""Runs programs of the build machine, and quotes their errors."""

import os
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path

from image.errors import ImageError

LAST_LINES = 15


def run(
    words: Sequence[str | Path],
    folder: Path | None = None,
    environment: Mapping[str, str] | None = None,
    given: str | None = None,
) -> str:
    """Run a program; return its output.

    folder       working directory.
    environment  added to this process's own. TZ=UTC and LC_ALL=C.UTF-8 are always set; mke2fs reads the names in a tar
                 by the latter.
    given        input of the program.

    Raises ImageError if the program is missing; also if it fails, with the last lines of its output.
    """
    name = Path(words[0]).name
    try:
        ended = subprocess.run(
            [str(word) for word in words],
            cwd=folder,
            env={**os.environ, "PATH": _path(), "TZ": "UTC", "LC_ALL": "C.UTF-8", **(environment or {})},
            input=given if given is not None else "",
            capture_output=True,
            text=True,
            errors="replace",
            check=False,
        )
    except FileNotFoundError as error:
        raise ImageError(f"{name}: program not found", "`.ci/setup image` installs it") from error
    if ended.returncode:
        said = "\n".join((ended.stderr or ended.stdout).strip().splitlines()[-LAST_LINES:])
        raise ImageError(f"{' '.join(map(str, words))[:200]}: ended with {ended.returncode}:\n{said}")
    return ended.stdout


def _path() -> str:
    """Return PATH with the folders of mke2fs, sfdisk and depmod, which a user's PATH may lack."""
    own = os.environ.get("PATH", "/usr/bin:/bin").split(":")
    return ":".join([*own, *(folder for folder in ("/usr/sbin", "/sbin") if folder not in own)])
