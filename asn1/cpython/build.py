"""Generated sources, runtime and the C of this folder to captain_messages.*.so. Only what has changed is compiled."""

import hashlib
import os
import shlex
import shutil
import subprocess
import sysconfig
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path

HERE = Path(__file__).parent
NAME = "captain_messages"
# abi3: one wheel for CPython 3.10 and later; slower, see compat.h
LIMITED = "-DPy_LIMITED_API=0x030A0000"
FLAGS = (
    "-std=c11", "-O2", "-DNDEBUG", "-fPIC", "-fvisibility=hidden", "-fno-semantic-interposition",
    "-Wall", "-Wextra", "-Wconversion", "-Werror",
)  # fmt: skip
# -s: symbols of 10,000 functions that nobody calls by name
LINK = ("-shared", "-s", "-Wl,-O1,--gc-sections,-Bsymbolic-functions")

Progress = Callable[[str], None]


class BuildError(Exception):
    """A compiler is missing, or what it said."""


def build_python(generated: Path, out: Path, *, is_limited: bool = False, progress: Progress = lambda _: None) -> Path:
    """Compile and link the module; returns its path.

    generated   a folder with include/captain and src, as `library.fill(..., "sources", ...)` writes it
    out         gets captain_messages.<abi>.so; objects stay in <out>/.objects, so that the next build is short
    is_limited  for the limited API (abi3)
    progress    told the name of each source that is compiled

    Raises BuildError with the compiler's words.
    """
    flags = (*FLAGS, *((LIMITED,) if is_limited else ()), *shlex.split(os.environ.get("CFLAGS", "")))
    includes = (f"-I{generated / 'include'}", f"-I{generated / 'src'}")
    python: tuple[str, ...] = (f"-I{HERE}", "-isystem", sysconfig.get_path("include"))
    folders = [HERE]
    if (generated / "src" / "cdr.h").exists():
        folders.append(HERE / "ros2")
        python += (f"-I{HERE / 'ros2'}", "-DCAPTAIN_ROS2")
    objects = out / ".objects"
    objects.mkdir(parents=True, exist_ok=True)
    jobs = [(source, flags + includes) for source in sorted((generated / "src").glob("*.c"))]
    jobs += [(source, flags + includes + python) for folder in folders for source in sorted(folder.glob("*.c"))]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        made = list(pool.map(lambda job: _compile(job[0], job[1], objects, progress), jobs))
    _remove_others(objects, made)
    suffix = ".abi3.so" if is_limited else sysconfig.get_config_var("EXT_SUFFIX")
    return _link(made, out / f"{NAME}{suffix}")


def _remove_others(objects: Path, made: list[Path]) -> None:
    """Objects of sources that are no more."""
    stems = {object_.stem for object_ in made} | {"link"}
    for path in objects.iterdir():
        if path.stem not in stems:
            path.unlink()


def _compile(source: Path, flags: tuple[str, ...], objects: Path, progress: Progress) -> Path:
    """One object; its key, beside it, is a hash of everything it was made from."""
    object_ = objects / f"{source.parent.name}-{source.stem}.o"
    key, needs = object_.with_suffix(".key"), object_.with_suffix(".d")
    if object_.exists() and key.exists() and key.read_text() == _key(flags, needs):
        return object_
    progress(source.name)
    key.unlink(missing_ok=True)  # until the object is whole
    _run((*_compiler(), *flags, "-MMD", "-MF", str(needs), "-c", str(source), "-o", str(object_)))
    key.write_text(_key(flags, needs))
    return object_


def _link(objects: Iterable[Path], module: Path) -> Path:
    paths = [str(path) for path in objects]
    key = module.parent / ".objects" / "link.key"
    now = _hash([module.name, *LINK, *(Path(path).with_suffix(".key").read_text() for path in paths)])
    if module.exists() and key.exists() and key.read_text() == now:
        return module
    new = module.with_suffix(".new")  # by rename: a program that has the module open keeps the old one
    _run((*_compiler(), *LINK, *paths, "-o", str(new)))
    new.replace(module)
    key.write_text(now)
    return module


def _key(flags: tuple[str, ...], needs: Path) -> str:
    """needs: what the compiler read, as make wants to know it."""
    if not needs.exists():
        return ""
    names = needs.read_text().replace("\\\n", " ").split(":", 1)[1].split()
    if not all(Path(name).exists() for name in names):
        return ""
    return _hash([_version(), *flags, *(_content(Path(name)) for name in names)])


def _hash(parts: Iterable[str]) -> str:
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()


@cache
def _digest(path: Path, _changed_ns: int, _octets: int) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _content(path: Path) -> str:
    status = path.stat()
    return _digest(path, status.st_mtime_ns, status.st_size)


@cache
def _compiler() -> tuple[str, ...]:
    chosen = shlex.split(os.environ.get("CC", ""))
    if chosen:
        return tuple(chosen)
    for name in ("cc", "gcc", "clang"):
        if shutil.which(name):
            return (name,)
    raise BuildError("no C compiler: install gcc or clang, or name one in CC")


@cache
def _version() -> str:
    return subprocess.run((*_compiler(), "--version"), capture_output=True, text=True, check=False).stdout


def _run(command: tuple[str, ...]) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise BuildError(f"{shlex.join(command)}\n{done.stderr.strip()}")
