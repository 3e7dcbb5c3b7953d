"""Build of captain_messages.*.so from generated sources, runtime and this folder's C.

Only changed sources are compiled.
"""

import base64
import hashlib
import os
import shlex
import shutil
import subprocess
import sysconfig
import zipfile
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path

from asn1.backends.backend import BackendError

HERE = Path(__file__).parent
NAME = "captain_messages"
# Limited API (abi3): one wheel for CPython 3.10 and later. It is slower, see compat.h.
LIMITED = "-DPy_LIMITED_API=0x030A0000"
FLAGS = (
    "-std=c11", "-O2", "-DNDEBUG", "-fPIC", "-fvisibility=hidden", "-fno-semantic-interposition",
    "-Wall", "-Wextra", "-Wconversion", "-Werror",
)  # fmt: skip
# -s removes the symbols of 10,000 functions, which no program looks up by name.
LINK = ("-shared", "-s", "-Wl,-O1,--gc-sections,-Bsymbolic-functions")
WHEEL_PYTHON = "cp310-abi3"  # tag of a module built with is_limited=True: CPython 3.10 and later
EPOCH = (1980, 1, 1, 0, 0, 0)  # earliest date of the zip format; generated files contain no real dates

Progress = Callable[[str], None]


class BuildError(BackendError):
    """No C compiler, or its error output."""


def build_python(generated: Path, out: Path, *, is_limited: bool = False, progress: Progress = lambda _: None) -> Path:
    """Compile and link the module. Returns its path.

    generated   folder with include/captain and src, written by the format sources (c/form.py).
    out         folder for captain_messages.<abi>.so. Objects stay in <out>/.objects, to speed up the next build.
    is_limited  build for the limited API (abi3).
    progress    called with the name of each compiled source.

    Raises BuildError with the compiler's output.
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
    """Remove objects whose sources no longer exist."""
    stems = {object_.stem for object_ in made} | {"link"}
    for path in objects.iterdir():
        if path.stem not in stems:
            path.unlink()


def _compile(source: Path, flags: tuple[str, ...], objects: Path, progress: Progress) -> Path:
    """Compile a source unless its object is current. A key file beside the object has the hash of all its inputs."""
    object_ = objects / f"{source.parent.name}-{source.stem}.o"
    key, needs = object_.with_suffix(".key"), object_.with_suffix(".d")
    if object_.exists() and key.exists() and key.read_text() == _key(flags, needs):
        return object_
    progress(source.name)
    key.unlink(missing_ok=True)  # rewritten when the object is complete
    _run((*_compiler(), *flags, "-MMD", "-MF", str(needs), "-c", str(source), "-o", str(object_)))
    key.write_text(_key(flags, needs))
    return object_


def _link(objects: Iterable[Path], module: Path) -> Path:
    paths = [str(path) for path in objects]
    key = module.parent / ".objects" / "link.key"
    now = _hash([module.name, *LINK, *(Path(path).with_suffix(".key").read_text() for path in paths)])
    if module.exists() and key.exists() and key.read_text() == now:
        return module
    new = module.with_suffix(".new")  # replaced by rename, so that running programs keep the old module
    _run((*_compiler(), *LINK, *paths, "-o", str(new)))
    new.replace(module)
    key.write_text(now)
    return module


def _key(flags: tuple[str, ...], needs: Path) -> str:
    """Return the hash of an object's inputs; "" if one is missing.

    needs: dependency file (make format) of the compiler.
    """
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


def write_wheel(folder: Path, version: str, module: Path, stub: str) -> Path:
    """Write <name>-<version>-<tag>.whl (PEP 427, PEP 561) into a folder. The same input gives the same octets.

    module  shared object for the limited API.
    stub    text of the .pyi.
    """
    tag = f"{WHEEL_PYTHON}-{sysconfig.get_platform().replace('-', '_').replace('.', '_')}"
    about = f"{NAME}-{version}.dist-info"
    files = {
        module.name: module.read_bytes(),
        f"{NAME}-stubs/__init__.pyi": stub.encode(),
        f"{about}/METADATA": _lines(
            "Metadata-Version: 2.1", f"Name: {NAME}", f"Version: {version}", "Requires-Python: >=3.10",
            "Summary: ETSI ITS messages: encode, decode, validate, JSON, explain", "License: Apache-2.0",
        ),
        f"{about}/WHEEL": _lines(
            "Wheel-Version: 1.0", "Generator: captain-asn1", "Root-Is-Purelib: false", f"Tag: {tag}"
        ),
    }  # fmt: skip
    record = [f"{name},sha256={_record_digest(octets)},{len(octets)}" for name, octets in files.items()]
    files[f"{about}/RECORD"] = _lines(*record, f"{about}/RECORD,,")
    path = folder / f"{NAME}-{version}-{tag}.whl"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, octets in files.items():
            entry = zipfile.ZipInfo(name, EPOCH)
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, octets, zipfile.ZIP_DEFLATED)
    return path


def _lines(*lines: str) -> bytes:
    return "".join(f"{line}\n" for line in lines).encode()


def _record_digest(octets: bytes) -> str:
    """Return a digest in the form of RECORD (PEP 376, 427): URL-safe base64 without padding."""
    return base64.urlsafe_b64encode(hashlib.sha256(octets).digest()).rstrip(b"=").decode()
