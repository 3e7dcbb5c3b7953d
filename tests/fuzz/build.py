"""Builds a fuzzing program per message: clang with libFuzzer, AddressSanitizer and UndefinedBehaviorSanitizer."""

import os
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from asn1.backends.backend import Job
from asn1.backends.registry import BACKENDS
from asn1.backends.ros2.options import Ros2Options
from asn1.layout import layout
from asn1.model import selection
from asn1.model.types import Schema

SANITIZERS = "address,undefined"
# Comparisons are not traced: that took half the time, and what is compared stands in an input shifted by some bits, where libFuzzer
# does not find it; as many inputs reach as many edges without.
UNTRACED = "-fno-sanitize-coverage=trace-cmp"
FLAGS = (
    "-std=c11", "-O2", "-g", "-Wall", "-Wextra", "-Wconversion", "-Werror",
    "-fno-omit-frame-pointer", "-fno-sanitize-recover=all", "-ffunction-sections", "-fdata-sections",
    UNTRACED,
)  # fmt: skip
FLAGS_NS = Path(__file__).stat().st_mtime_ns
TARGET = Path(__file__).with_name("target.c")
CDR_TARGET = Path(__file__).with_name("cdr.c")


class BuildError(RuntimeError):
    """A tool is missing, or a source does not compile; str() says which."""


def programs(schema: Schema, messages: tuple[str, ...], folder: Path, jobs: int) -> dict[str, Path]:
    """The programs by message, in folder/bin; only what has changed is compiled. Raises BuildError."""
    clang = shutil.which("clang")
    if clang is None:
        raise BuildError("clang is missing; as root: apt-get install clang")
    # All messages, so that a selection does not make the next run compile everything again.
    everything = tuple(schema.messages)
    sources = folder / "sources"
    BACKENDS["sources"].write(Job(schema, everything, Ros2Options(with_cdr=True)), sources, lambda what: None)
    flags = [*FLAGS, f"-I{sources / 'include'}"]
    newest = _newest_ns(path for path in sources.rglob("*.h") if not _is_ros2(path))
    chosen = layout.lay_out(schema, [schema.messages[name] for name in messages])
    others = set(schema.modules) - selection.reached(schema, set(chosen.nodes))
    needed = [path for path in sorted((sources / "src").glob("*.c")) if path.stem.removesuffix("_tables") not in others]
    needed = [path for path in needed if not _is_ros2(path)]
    with ThreadPoolExecutor(jobs) as pool:
        objects = list(pool.map(lambda path: _object(clang, flags, path, folder / "objects", newest), needed))
        pdus = [chosen.pdus[name] for name in messages]
        link = [(name, pdu.module, pdu.c_name) for name, pdu in zip(messages, pdus, strict=True)]
        made = list(pool.map(lambda one: _program(clang, flags, one, objects, folder / "bin"), link))
    return dict(zip(messages, made, strict=True))


def cdr_program(schema: Schema, folder: Path, jobs: int) -> Path:
    """The program of all messages as CDR, after `programs`, which writes the sources. Raises BuildError."""
    clang = shutil.which("clang") or "clang"
    sources = folder / "sources"
    flags = [*FLAGS, f"-I{sources / 'include'}"]
    headers = sorted(sources.rglob("*.h"))
    newest = {
        is_ros2: _newest_ns(path for path in headers if is_ros2 or not _is_ros2(path)) for is_ros2 in (False, True)
    }
    with ThreadPoolExecutor(jobs) as pool:
        paths = sorted((sources / "src").glob("*.c"))
        objects = list(
            pool.map(lambda path: _object(clang, flags, path, folder / "objects", newest[_is_ros2(path)]), paths)
        )
    made = folder / "bin" / "cdr"
    if not _is_newer(made, _newest_ns((*objects, CDR_TARGET))):
        _run([clang, *flags, f"-fsanitize=fuzzer,{SANITIZERS}", str(CDR_TARGET), *map(str, objects), "-o", str(made)])
    return made


def _is_ros2(path: Path) -> bool:
    """What goes to ROS 2 and back; the programs of the messages have nothing of it."""
    return path.stem == "ros2" or path.stem.startswith(("cdr", "ros2_"))


def python_module(folder: Path) -> Path:
    """The folder of the Python module, compiled so that atheris sees the coverage of its C. Raises BuildError."""
    module = folder / "python"
    command = [sys.executable, "-m", "asn1", "generate", "--all", "--format", "python", "--to", str(module)]
    flags = f"-g -fsanitize=fuzzer-no-link,undefined -fno-sanitize-recover=all {UNTRACED}"
    _run(command, CC="clang", CFLAGS=flags)
    return module


def preload(module: Path) -> dict[str, str]:
    """The environment in which atheris runs with such a module: the fuzzer comes first, then UBSan finds itself in it."""
    fuzzer = Path(sysconfig.get_path("platlib")) / "ubsan_with_fuzzer.so"
    return {"LD_PRELOAD": str(fuzzer), "PYTHONPATH": str(module)}


def _object(clang: str, flags: list[str], source: Path, folder: Path, headers_ns: int) -> Path:
    made = folder / f"{source.stem}.o"
    if not _is_newer(made, max(headers_ns, source.stat().st_mtime_ns, FLAGS_NS)):
        folder.mkdir(parents=True, exist_ok=True)
        _run([clang, *flags, f"-fsanitize=fuzzer-no-link,{SANITIZERS}", "-c", str(source), "-o", str(made)])
    return made


def _program(clang: str, flags: list[str], of: tuple[str, str, str], objects: list[Path], folder: Path) -> Path:
    """Linked from an archive, so that a program holds, and counts the coverage of, only the modules of its message."""
    name, module, pdu = of
    made = folder / name
    if not _is_newer(made, _newest_ns((*objects, TARGET))):
        folder.mkdir(parents=True, exist_ok=True)
        of_target = [f'-DFUZZ_HEADER="captain/{module}.h"', f"-DFUZZ_TYPE={pdu}_type"]
        library = folder / f"{name}.a"
        library.unlink(missing_ok=True)
        _run(["ar", "rcsDT", str(library), *map(str, objects)])
        _run([clang, *flags, *of_target, f"-fsanitize=fuzzer,{SANITIZERS}", str(TARGET), str(library), "-o", str(made)])
    return made


def _newest_ns(paths: Iterable[Path]) -> int:
    return max(path.stat().st_mtime_ns for path in paths)


def _is_newer(made: Path, than_ns: int) -> bool:
    return made.exists() and made.stat().st_mtime_ns >= than_ns


def _run(command: list[str], **environment: str) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=False, env={**os.environ, **environment})
    if done.returncode:
        raise BuildError(f"{command[0]} failed:\n{done.stderr[-4000:]}")
