"""A quick start of a card: its kernel, its early boot and its root, and a program of ours in place of systemd.

The program runs by the image's own Python, which lies with our sources on a second drive.
"""

import base64
import json
import platform
from pathlib import Path

from image.description import Description, Partition, read
from image.filesystem import disk
from image.filesystem.ext4 import FileSystem
from image.filesystem.tree import Tree
from image.tool import run
from tests.proof.image.machine import BARE_VIRT, Machine, Ports

PROJECT = Path(__file__).resolve().parents[3]
MADE = PROJECT / "build/image"
WORKLOAD = "tests.proof.image.workload"
# Of the root that the freezer works in: Python, and the libraries that it is linked with.
LIBRARIES = "usr/lib/aarch64-linux-gnu"
PYTHON = "usr/lib/python3.13"
# Compiling takes an emulated machine longer than all else of a start: it is done once, by the same Python of this machine's
# processor. What it has imported for the workload is what the guest needs; bytecode is the same for every processor.
COMPILED = """
import base64, importlib._bootstrap_external as external, json, runpy, sys, {workload}
def octets(path):
    with open(path, encoding="utf-8") as file:
        return bytes(external._code_to_timestamp_pyc(compile(file.read(), path, "exec")))
paths = {{getattr(module, "__file__", None) or "" for module in sys.modules.values()}}
print(json.dumps({{path: base64.b64encode(octets(path)).decode() for path in paths if path.endswith(".py")}}))
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
    for place, octets in _compiled(MADE / "freezer/here").items():
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


def _compiled(here: Path) -> dict[str, bytes]:
    """Our modules and Python's own, as far as the workload takes them, by their places on the drive."""
    libraries = here / f"usr/lib/{platform.machine()}-linux-gnu"
    loader = next(libraries.glob("ld-linux-*.so.*"))
    words: list[str | Path] = [loader, "--library-path", libraries, here / "usr/bin/python3.13"]
    words += ["-S", "-B", "-c", COMPILED.format(workload=WORKLOAD)]
    made = json.loads(run(words, folder=PROJECT, environment={"PYTHONHOME": str(here / "usr")}))
    return {_place(Path(path), here): base64.b64decode(octets) for path, octets in made.items()}


def _place(source: Path, here: Path) -> str:
    is_pythons = source.is_relative_to(here)
    return str((source.relative_to(here) if is_pythons else "src" / source.relative_to(PROJECT)).with_suffix(".pyc"))
