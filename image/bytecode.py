"""Our own modules as bytecode: `python3 bytecode.py ROOT TARGET`, by whichever Python is to run them.

It needs the standard library alone: an emulated Python has nothing else. What it writes is read by `read`.
"""

import marshal
import sys
from collections.abc import Iterator
from pathlib import Path
from types import CodeType
from typing import NamedTuple

FOLDERS = ("board", "drivers", "firmware", "pps")
# What our modules read beside themselves.
DATA = ("board/boards/*.toml", "drivers/profiles/*.toml", "firmware/*.json", "firmware/meter/assets/*")
# Packages for where ROS is, which are installed there; nothing of captain imports them.
GATEWAY = "firmware/gateway"
SCRIPT = "firmware/__main__.py"
OPTIMIZATION = 2  # without docstrings and assertions


class Module(NamedTuple):
    """A compiled module. code: marshalled, as a .pyc has it behind its head."""

    name: str
    is_package: bool
    code: bytes


class Compiled(NamedTuple):
    """Everything of ours. script: what the program begins with."""

    modules: list[Module]
    script: bytes


def sources(root: Path) -> Iterator[Path]:
    """Files of our modules, sorted: the order has a part in what marshal writes."""
    for folder in FOLDERS:
        found = sorted((root / folder).rglob("*.py"))
        yield from (path for path in found if root / GATEWAY not in path.parents)


def name(place: Path) -> str:
    """As it is imported: firmware/cli.py -> firmware.cli. place: below the project's folder."""
    parts = place.with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def compiled(root: Path) -> Compiled:
    """Named as if they were in the working directory: no path of a build gets in. Raises SyntaxError."""
    found = []
    for path in sources(root):
        place = path.relative_to(root)
        found.append(Module(name(place), place.stem == "__init__", _code(path, str(place))))
    return Compiled(found, _code(root / SCRIPT, "__main__.py"))


def write(all_of_ours: Compiled, target: Path) -> None:
    target.write_bytes(marshal.dumps(([tuple(module) for module in all_of_ours.modules], all_of_ours.script)))


def read(path: Path) -> Compiled:
    """What write() wrote, maybe by another Python: names and octets, which each knows."""
    modules, script = marshal.loads(path.read_bytes())
    return Compiled([Module(*row) for row in modules], script)


def _code(path: Path, name: str) -> bytes:
    code: CodeType = compile(path.read_bytes(), name, "exec", dont_inherit=True, optimize=OPTIMIZATION)
    return marshal.dumps(code)


if __name__ == "__main__":
    write(compiled(Path(sys.argv[1])), Path(sys.argv[2]))
