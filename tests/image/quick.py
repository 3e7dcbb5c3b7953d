"""A quick start of a card: its kernel, its early boot and its root, and a program of ours in place of systemd.

The program runs by the image's own Python, which lies with our sources on a second drive.
"""

import base64
import json
import subprocess
import sys
from pathlib import Path

from image import disk
from image.description import Description, Partition, read
from image.ext4 import FileSystem
from image.program import run
from image.tree import Tree
from tests.image.machine import BARE_VIRT, Machine, Ports

PROJECT = Path(__file__).resolve().parents[2]
MADE = PROJECT / "build/image"
WORKLOAD = "tests.image.workload"
# Of the root that the freezer works in: Python, and the libraries that it is linked with.
LIBRARIES = "usr/lib/aarch64-linux-gnu"
PYTHON = "usr/lib/python3.13"
# What the workload imports, said by an interpreter of this machine.
IMPORTS = "import sys, {workload}; print(*(name for name in sys.modules if name != '__main__'))"
OURS = ("board", "drivers", "firmware", "tests")
# Compiling takes an emulated machine longer than all else of a start: it is done once, by the image's own interpreter.
COMPILE = """
import base64, importlib._bootstrap_external as external, json, sys
def octets(name, text):
    return bytes(external._code_to_timestamp_pyc(compile(text, name, "exec")))
given = json.load(sys.stdin)
print(json.dumps({name: base64.b64encode(octets(name, text)).decode() for name, text in given.items()}))
"""
SIZE_MIB = 96
# By the shell of the root; the program is process 1.
START = (
    "exec </dev/console >/dev/console 2>&1; mount -t ext4 -o ro {drive} /mnt; "
    "export PYTHONHOME=/mnt/usr PYTHONPATH=/mnt/src PYTHONDONTWRITEBYTECODE=1 PATH=/usr/sbin:/usr/bin; "
    "exec /mnt/ld --library-path /mnt/{libraries} /mnt/usr/bin/python3.13 -S -m {workload}"
)


class Quick:
    """What quick starts of a card need, taken from it once.

    Raises ImageError where the folder of the build lacks it.
    """

    def __init__(self, card: Path, folder: Path) -> None:
        self._description = read(PROJECT / "image/image.toml")
        self._kernel, self._initrd = folder / "Image", folder / "initrd"
        self._drive = _drive(folder)
        with FileSystem(card, offset(self._description, "root-a"), MADE / "tools") as slot:
            for path in (self._kernel, self._initrd):
                path.write_bytes(slot.read(f"boot/{path.name}"))

    def machine(self, extra: str = "", options: str = "") -> Machine:
        """extra: of the kernel's command line; options: of the card's drive."""
        description = self._description
        words = (
            f"console=ttyAMA0 root=PARTUUID={description.disk.label_id:08x}-02 ro {description.kernel.command_line} {extra} "
            f'init=/bin/sh -- -c "{START.format(drive="/dev/vdb", libraries=LIBRARIES, workload=WORKLOAD)}"'
        )

        def command(card: Path, ports: Ports) -> list[str]:
            return [
                *BARE_VIRT,
                *("-kernel", str(self._kernel), "-initrd", str(self._initrd), "-append", words),
                *("-drive", f"file={card},format=raw,if=none,id=card{options}", "-device", "virtio-blk-pci,drive=card"),
                *("-drive", f"file={self._drive},format=raw,if=none,id=ours,readonly=on"),
                *("-device", "virtio-blk-pci,drive=ours"),
            ]

        return command


def offset(description: Description, name: str) -> int:
    """Of a partition, in octets."""
    return next(place.offset for place in disk.places(description.disk) if place.partition.name == name)


def _drive(folder: Path) -> Path:
    """The second drive: the image's Python and our modules, compiled."""
    root = MADE / "freezer/root"
    tree = Tree()
    for path in sorted((root / PYTHON).rglob("__pycache__/*.cpython-313.pyc")):
        module = path.parents[1].relative_to(root) / path.name.partition(".")[0]
        tree.write(f"{module}.pyc", path.read_bytes())
    for place, octets in _compiled(root).items():
        tree.write(place, octets)
    for path in [*(root / LIBRARIES).glob("*.so*"), *(root / PYTHON / "lib-dynload").glob("*.so")]:
        tree.write(str(path.relative_to(root)), path.read_bytes(), 0o755)
    tree.write("ld", (root / LIBRARIES / "ld-linux-aarch64.so.1").read_bytes(), 0o755)
    tree.write("usr/bin/python3.13", (root / "usr/bin/python3.13").read_bytes(), 0o755)
    tar, target = folder / "quick.tar", folder / "quick.ext4"
    tree.save(tar, 0)
    partition = Partition("quick", 1, "root", SIZE_MIB, "6d0c3a52-6a3e-4b0e-9c1a-0f6f6c2d0a02")
    disk.make_ext4(partition, tar, target, 1, MADE / "tools", journal=False)
    tar.unlink()
    return target


def _compiled(root: Path) -> dict[str, bytes]:
    """Our modules, and those of Python that the freezer has not used, by their places."""
    words = IMPORTS.format(workload=WORKLOAD)
    said = subprocess.run([sys.executable, "-c", words], cwd=PROJECT, capture_output=True, text=True, check=True).stdout
    sources: dict[str, str] = {}
    for name in said.split():
        is_ours = name.partition(".")[0] in OURS
        source = _source((PROJECT if is_ours else root / PYTHON) / name.replace(".", "/"))
        if source is not None and (
            is_ours or not (source.parent / f"__pycache__/{source.stem}.cpython-313.pyc").exists()
        ):
            place = Path("src") / source.relative_to(PROJECT) if is_ours else source.relative_to(root)
            sources[str(place.with_suffix(".pyc"))] = source.read_text()
    its: list[str | Path] = ["qemu-aarch64-static", "-L", root, root / "usr/bin/python3.13", "-S", "-c", COMPILE]
    made = run(its, given=json.dumps(sources), environment={"PYTHONHOME": str(root / "usr")})
    return {place: base64.b64decode(text) for place, text in json.loads(made).items()}


def _source(module: Path) -> Path | None:
    return next((path for path in (module.with_suffix(".py"), module / "__init__.py") if path.exists()), None)
