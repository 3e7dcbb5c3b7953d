"""Programs of the build machine that the image is made by: run to their end, and quoted where they fail."""

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
    """What a program writes to its output.

    folder       it is run in.
    environment  in addition to this process's own; always with TZ=UTC and LC_ALL=C.UTF-8.
                 (mke2fs reads names in a tar by it)
    given        to its input.

    Raises ImageError: it is not there, or it failed, with its last lines.
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
        raise ImageError(f"{name}: there is no such program", "`.ci/setup image` installs it") from error
    if ended.returncode:
        said = "\n".join((ended.stderr or ended.stdout).strip().splitlines()[-LAST_LINES:])
        raise ImageError(f"{' '.join(map(str, words))[:200]}: ended with {ended.returncode}:\n{said}")
    return ended.stdout


def _path() -> str:
    """mke2fs, sfdisk and depmod are in sbin, which a user's PATH may lack."""
    own = os.environ.get("PATH", "/usr/bin:/bin").split(":")
    return ":".join([*own, *(folder for folder in ("/usr/sbin", "/sbin") if folder not in own)])
