"""The C programs of the benchmark, compiled into build/bench where they are older than their sources."""

import shutil
import subprocess
from pathlib import Path

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
BUILD = ROOT / "build" / "bench"
FLAGS = ("-std=c11", "-O2", "-Wall", "-Wextra", "-Wconversion", "-Werror")
SOURCES = {
    "floor": ("floor.c",),
    "flow": ("flow.c", "load.c"),
    "first": ("first.c", "load.c"),
}


class MissingToolError(Exception):
    """Something that the benchmark needs is not installed; the message is one line that names the package."""


def build() -> None:
    """Compile what is not up to date. Raises MissingToolError."""
    if shutil.which("gcc") is None:
        raise MissingToolError("gcc is missing: apt install gcc")
    if _compile("-E", "-include", "zmq.h", "-x", "c", "/dev/null", "-o", "/dev/null").returncode:
        raise MissingToolError("zmq.h is missing: apt install libzmq3-dev")
    BUILD.mkdir(parents=True, exist_ok=True)
    for name, sources in SOURCES.items():
        paths = [HERE / source for source in sources]
        if _is_older(BUILD / name, [*paths, HERE / "load.h"]):
            done = _compile(*FLAGS, *map(str, paths), "-o", str(BUILD / name), "-lzmq", "-lpthread")
            if done.returncode:
                raise RuntimeError(done.stderr)


def path(name: str) -> str:
    return str(BUILD / name)


def _compile(*arguments: str) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(["gcc", *arguments], capture_output=True, text=True, check=False)


def _is_older(made: Path, sources: list[Path]) -> bool:
    return not made.exists() or made.stat().st_mtime < max(source.stat().st_mtime for source in sources)
