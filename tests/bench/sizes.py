"""`python -m tests.bench.sizes`: how large the message library is, code and tables apart.

All messages of all editions in one stripped shared library, and what decode, encode and validate of the CAM need.
"""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

from asn1.backends.backend import Job
from asn1.backends.registry import BACKENDS
from asn1.model import text

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "build" / "bench" / "sizes"
# Those of asn1/backends/cmake/template/CMakeLists.txt.
FLAGS = ("-std=c11", "-O2", "-DNDEBUG", "-fPIC", "-ffunction-sections", "-fdata-sections",
         "-fno-unwind-tables", "-fno-asynchronous-unwind-tables")  # fmt: skip
CODE = (".text", ".plt", ".init", ".fini")
LIBRARY_GOAL = 3_000_000
CAM_GOAL = 40_000
HOT = ("captain_decode", "captain_encode", "captain_validate", "r1_cam_CAM_type")


def main() -> int:
    """Builds both, prints code, tables and size beside what is to be reached."""
    schema = text.load_schema()
    everything = _shared(tuple(schema.messages))
    size, code, tables = everything.stat().st_size, *_sections(everything)
    print(f"{len(schema.messages)} messages, shared library, stripped: {size:,} octets", _verdict(size, LIBRARY_GOAL))
    print(f"  code {code:,}, tables {tables:,}")
    code, tables = _sections(_only("cam", ("cam-1.4.1",), HOT))
    print(f"cam-1.4.1, decode, encode and validate: code {code:,} octets", _verdict(code, CAM_GOAL))
    print(f"  tables {tables:,}")
    return 0


def _shared(messages: tuple[str, ...]) -> Path:
    """The shared library as a user builds and strips it, with everything in it that the headers declare."""
    folder = FOLDER / "all"
    BACKENDS["cmake"].write(Job(text.load_schema(), messages), folder, lambda _: None)
    build = folder.with_name("all-build")
    shutil.rmtree(build, ignore_errors=True)  # it keeps the flags that it was first made with
    _run("cmake", "-S", str(folder), "-B", str(build), "-DCAPTAIN_MESSAGES_STATIC=OFF")
    _run("cmake", "--build", str(build), "-j", str(os.cpu_count()))
    made = next(path for path in build.glob("libcaptain_messages.so*") if not path.is_symlink())
    stripped = FOLDER / "all.so"
    _run("strip", "-o", str(stripped), str(made))
    return stripped


def _only(name: str, messages: tuple[str, ...], symbols: tuple[str, ...]) -> Path:
    """A stripped shared library of some symbols and what these need."""
    folder = FOLDER / name
    BACKENDS["sources"].write(Job(text.load_schema(), messages), folder, lambda _: None)
    objects = []
    for source in sorted((folder / "src").glob("*.c")):
        made = FOLDER / f"{name}-{source.stem}.o"
        _run("cc", *FLAGS, f"-I{folder / 'include'}", "-c", str(source), "-o", str(made))
        objects.append(str(made))
    versions = FOLDER / f"{name}.map"
    versions.write_text(f"{{ global: {'; '.join(symbols)}; local: *; }};\n")
    made = FOLDER / f"{name}.so"
    _run("cc", "-shared", "-s", "-Wl,--gc-sections", f"-Wl,--version-script={versions}", *objects, "-o", str(made))
    return made


def _sections(path: Path) -> tuple[int, int]:
    """Octets of code, and of constant tables, the relocations that a shared library needs for them included."""
    found = re.findall(r"^(\.\S+)\s+(\d+)", _run("size", "-A", str(path)), re.MULTILINE)
    sizes = {name: int(octets) for name, octets in found}
    tables = (".rodata", ".data.rel.ro", ".data.rel.ro.local", ".rela.dyn", ".relr.dyn", ".eh_frame", ".data")
    return sum(sizes.get(name, 0) for name in CODE), sum(sizes.get(name, 0) for name in tables)


def _run(*command: str) -> str:
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def _verdict(octets: int, goal: int) -> str:
    return f"(goal: below {goal:,}) {'reached' if octets < goal else 'MISSED'}"


if __name__ == "__main__":
    sys.exit(main())
