"""Compiles our own modules: `python3 bytecode.py ROOT TARGET`, by the target's Python.

It needs only the standard library, because an emulated Python has nothing else. `read` reads its output.
"""

import marshal
import sys
from collections.abc import Iterator
from pathlib import Path
from types import CodeType
from typing import NamedTuple

FOLDERS = ("board", "drivers", "firmware", "pps")
# A distribution of its own, whose import name is `captain_client`.
CLIENT = Path("firmware/captain_client/captain_client")
PACKAGES = (*FOLDERS, CLIENT.name)
# Data files that our modules read.
DATA = ("board/boards/*.toml", "drivers/mqtt/profiles/*.toml", "firmware/*.json", "firmware/meter/assets/*")
# Code that captain never imports: packages for hosts with ROS, programs of users, and the client for asyncio.
APART = ("firmware/gateway", "firmware/guide/examples", f"{CLIENT}/aio.py", f"{CLIENT}/aio_link.py")
SCRIPT = "firmware/__main__.py"
OPTIMIZATION = 2  # without docstrings and assertions


class OwnModule(NamedTuple):
    """Compiled module. code: marshalled, as in a .pyc after its header."""

    name: str
    is_package: bool
    code: bytes


class Compiled(NamedTuple):
    """All of our compiled modules. script: the main program."""

    modules: list[OwnModule]
    script: bytes


def sources(root: Path) -> Iterator[Path]:
    """Yield the files of our modules in sorted order, because marshal's output depends on the order."""
    for folder in FOLDERS:
        found = sorted((root / folder).rglob("*.py"))
        yield from (path for path in found if not {root / place for place in APART} & {path, *path.parents})


def name(place: Path) -> str:
    """Return the import name of a module: firmware.cli for firmware/cli.py. place: path relative to the project."""
    within = place.relative_to(CLIENT.parent) if place.is_relative_to(CLIENT) else place
    parts = within.with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def compiled(root: Path) -> Compiled:
    """Compile all our modules, with relative paths, so that they contain no path of the build. Raises SyntaxError."""
    found = []
    for path in sources(root):
        place = path.relative_to(root)
        found.append(OwnModule(name(place), place.stem == "__init__", _code(path, str(place))))
    return Compiled(found, _code(root / SCRIPT, "__main__.py"))


def write(all_of_ours: Compiled, target: Path) -> None:
    target.write_bytes(marshal.dumps(([tuple(module) for module in all_of_ours.modules], all_of_ours.script)))


def read(path: Path) -> Compiled:
    """Read the file of write(), also by another Python version, because it contains only names and octets."""
    modules, script = marshal.loads(path.read_bytes())
    return Compiled([OwnModule(*row) for row in modules], script)


def _code(path: Path, name: str) -> bytes:
    code: CodeType = compile(path.read_bytes(), name, "exec", dont_inherit=True, optimize=OPTIMIZATION)
    return marshal.dumps(code)


if __name__ == "__main__":
    write(compiled(Path(sys.argv[1])), Path(sys.argv[2]))
