"""Freezes captain by a Debian release's own Python, in roots that are never started.

Two roots have the same packages. `here` has this machine's processor and runs; `root` has the program's processor and
provides compiled files. They are one root if the processors are the same. Only the check of the result is emulated.
"""

import os
import shutil
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from image.errors import ImageError
from image.program import foreign, licences, translated
from image.program.contents import bytecode, layers
from image.project import PROJECT
from image.tool import run

SPEC = PROJECT / "firmware/captain.spec"
OPTIONS = ("--noconfirm", "--log-level", "ERROR")
LOCK = ".ci/locks/freeze.txt"
PLATFORMS = ("manylinux_2_28", "manylinux_2_17", "manylinux2014")
EPOCH = "315532800"  # 1980, the earliest date in PyInstaller's archives
RADIO = "drivers/sim/radio/libsim_v2xcast.so"
BUILT_RADIO = "build/sim/libsim_v2xcast.so"  # made by .ci/sim
WORK = "build"  # work folder in the root
OWNERS = "build/owners"  # list of files with the package of each

# `dpkg-deb -x` would replace the link /lib by a folder.
_EXTRACT = 'dpkg-deb --fsys-tarfile "$1" | tar -x --keep-directory-symlink -C "$2"'
# The root sees the machine's /dev and /proc. The mounts end with the process, which has a mount namespace of its own.
_INSIDE = """\
root=$1; shift; mount --rbind /dev "$root/dev" && mount -t proc proc "$root/proc" && exec chroot "$root" \
/usr/bin/env -i PATH=/usr/bin HOME=/tmp LC_ALL=C.UTF-8 PYTHONHASHSEED=0 PYTHONPATH=/build/site "$@"
"""


class Processor(NamedTuple):
    """Processor for which captain is made.

    name    Linux' name: aarch64.
    debian  Debian's name: arm64.
    loader  path in PyInstaller's wheel of the executable that starts a frozen program.
    """

    name: str
    debian: str
    loader: str

    @property
    def triple(self) -> str:
        """Prefix of the names of its compiler and binutils."""
        return f"{self.name}-linux-gnu"

    @property
    def tools(self) -> layers.Tools:
        return layers.Tools(f"{self.triple}-objcopy", f"{self.triple}-strip")


AARCH64 = Processor("aarch64", "arm64", "PyInstaller/bootloader/Linux-64bit-arm/run")
X86_64 = Processor("x86_64", "amd64", "PyInstaller/bootloader/Linux-64bit-intel/run")


def inputs() -> list[Path]:
    """Return the input files of our part of the program, except the messages."""
    folders = [PROJECT / name for name in bytecode.FOLDERS]
    found = [path for folder in folders for path in folder.rglob("*") if path.is_file() and path.suffix != ".pyc"]
    here = Path(__file__).parent
    build = [here / "frozen.py", here / "translated.py", *(here / "contents").glob("*.py")]
    return sorted([*found, PROJECT / ".ci/sim", *build])


def messages_inputs() -> list[str | Path]:
    """Return the input files of the module of all messages."""
    found = [path for path in (PROJECT / "asn1").rglob("*") if path.is_file() and path.suffix not in (".pyc", ".md")]
    return sorted([*found, Path(__file__)])


def unpack(packages: Iterable[Path], root: Path, processor: str, python: Path) -> None:
    """Make one of the two roots from packages, without running their scripts, and wheels.

    processor  Linux' name: aarch64.
    python     Python of the project's environment, with pip.

    Raises ImageError if the packages contain no Python, or more than one.
    """
    lay_out(packages, root)
    interpreter = sorted(path.name for path in (root / "usr/bin").glob("python3.[0-9]*") if path.name[9:].isdecimal())
    if len(interpreter) != 1:
        raise ImageError(f"packages to freeze with: {interpreter or 'no Python'}", "name one Python: python3.13")
    (root / "usr/bin/python3").unlink(missing_ok=True)
    (root / "usr/bin/python3").symlink_to(interpreter[0])
    _fetch_wheels(root / WORK / "site", version(root), processor, python)


def lay_out(packages: Iterable[Path], root: Path) -> None:
    """Unpack packages into a root with merged /usr, and list the package of each file.

    Packages of Debian 12 have files in /lib itself, which go into /usr/lib as in Debian 13. Raises ImageError if a
    tool fails.
    """
    for folder in ("usr/bin", "usr/sbin", "usr/lib", "usr/lib64", "dev", "proc", "tmp", WORK):
        (root / folder).mkdir(parents=True, exist_ok=True)
    for link in ("bin", "sbin", "lib", "lib64"):
        (root / link).symlink_to(f"usr/{link}")
    owners = []
    for package in packages:
        run(["sh", "-c", _EXTRACT, "sh", package, root])
        name = package.name.split("_")[0]
        owners += [f"{name}: {line.split()[5]}\n" for line in run(["dpkg-deb", "-c", package]).splitlines()]
    (root / OWNERS).write_text("".join(owners))


def version(root: Path) -> str:
    """Return the version of the root's Python: 3.13."""
    return (root / "usr/bin/python3").readlink().name.removeprefix("python")


def imports(root: Path) -> list[str]:
    """Return the third-party modules that our modules import."""
    return foreign.imports(PROJECT, [root / f"usr/lib/python{version(root)}", root / WORK / "site"])


def freeze(here: Path, root: Path, processor: Processor, names: Iterable[str], target: Path) -> None:
    """Freeze the third-party modules as a directory, for the root's processor. Raises ImageError if a tool fails."""
    place = cleared(here / WORK / "foreign")
    shutil.copy(SPEC, place)
    (place / "__main__.py").write_text(foreign.script(names))
    inside = Path("/") / place.relative_to(here)
    words: list[str | Path] = ["/usr/bin/python3", "-m", "PyInstaller", *OPTIONS, "--workpath", inside / "work"]
    settings = [f"SOURCE_DATE_EPOCH={EPOCH}", f"PYINSTALLER_CONFIG_DIR={inside}/work"]
    run_inside(here, [*settings, *words, "--distpath", inside, inside / SPEC.name])
    site = root / WORK / "site"
    libraries = translated.Libraries(
        [*site.glob("*.libs"), root / f"usr/lib/{processor.triple}", root / "usr/lib"], (root / OWNERS).read_text()
    )
    others = [site, root / "usr/lib"]
    translated.translate(place / "captain-dir", others, libraries, site / processor.loader, processor.tools, target)
    look = cleared(root / WORK / "look")
    shutil.copytree(target, look / "captain", symlinks=True)
    run_inside(root, [Path("/") / look.relative_to(root) / "captain/captain"])  # check: imports all, in emulation


def compile_messages(root: Path, processor: Processor, python: Path, target: Path) -> Path:
    """Compile the module of all messages by the cross compiler, with the headers of the root's Python.

    python  Python of the project's environment, which generates the messages.

    Raises ImageError if captain-asn1 makes no module.
    """
    headers = _headers(root, processor)
    flags = [
        # -isystem: searched before the headers of this Python, and without their warnings.
        f"-isystem {headers}/python{version(root)} -isystem {headers}",
        f"-ffile-prefix-map={target}=codec",
        "-fno-asynchronous-unwind-tables",  # tables for exceptions, which C lacks: a tenth of the module
    ]
    run(
        [python, "-m", "asn1", "generate", "--all", "--format", "python", "--to", target],
        folder=PROJECT,
        environment={"CC": f"{processor.triple}-gcc", "CFLAGS": " ".join(flags)},
    )
    made = sorted(target.glob(f"{foreign.MESSAGES}*.so"))
    if not made:
        raise ImageError(f"{target}: captain-asn1 has made no module")
    suffix = f".cpython-{version(root).replace('.', '')}-{processor.triple}.so"
    return made[0].rename(target / f"{foreign.MESSAGES}{suffix}")


def join(here: Path, processor: Processor, frozen: Path, messages: Path, target: Path) -> None:
    """Join captain as a directory. frozen: result of freeze(). Raises ImageError if a tool fails."""
    place = cleared(here / WORK / "ours")
    for name in (*bytecode.FOLDERS, ".ci"):
        shutil.copytree(PROJECT / name, place / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(bytecode.__file__, place / "bytecode.py")
    run(["sh", ".ci/sim"], folder=place, environment={"CC": f"{processor.triple}-gcc"})
    inside = Path("/") / place.relative_to(here)
    run_inside(here, ["/usr/bin/python3", inside / "bytecode.py", inside, inside / "compiled"])
    beside = layers.files(place, {messages.name: messages, RADIO: place / BUILT_RADIO})
    layers.directory(frozen, bytecode.read(place / "compiled"), beside, processor.tools, target)


def documents(root: Path, program: Path) -> dict[str, bytes]:
    """Return the documents of captain, by path below /usr/share/doc/captain."""
    packages = licences.of_libraries(program, (root / OWNERS).read_text())
    notices = [root / f"usr/share/doc/{name}/copyright" for name in packages]
    return licences.documents(program, root / WORK / "site", [path for path in notices if path.exists()])


def run_inside(root: Path, words: Iterable[str | Path]) -> str:
    """Run a program of the root, inside the root; return its output."""
    return run(["unshare", "--mount", "sh", "-c", _INSIDE, "sh", root, *words])


def cleared(place: Path) -> Path:
    """Make an empty folder in place of an old one; return its path."""
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir(parents=True)
    return place


def _fetch_wheels(site: Path, version: str, processor: str, python: Path) -> None:
    abi = "cp" + version.replace(".", "")
    platforms = [word for platform in PLATFORMS for word in ("--platform", f"{platform}_{processor}")]
    words = ["-q", "--no-input", "--require-hashes", "--only-binary", ":all:", "--no-compile"]
    target = ["--python-version", version, "--implementation", "cp", "--abi", abi, "--abi", "abi3", "--abi", "none"]
    run([python, "-m", "pip", "install", *words, "--target", site, *target, *platforms, "-r", LOCK], folder=PROJECT)


def _headers(root: Path, processor: Processor) -> Path:
    """Copy Python's headers only: the cross compiler has its own C library, and the root's is of another release."""
    headers = root / WORK / "headers"
    shutil.rmtree(headers, ignore_errors=True)
    for name in (f"python{version(root)}", f"{processor.triple}/python{version(root)}"):
        shutil.copytree(root / "usr/include" / name, headers / name)
    return headers


def own_python() -> Path:
    """Return the Python of the project's environment, else the running one."""
    found = PROJECT / ".venv/bin/python"
    return found if os.access(found, os.X_OK) else Path(sys.executable)
