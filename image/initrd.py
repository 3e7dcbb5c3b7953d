"""The early boot: a static busybox, the modules that reach the root, and the script that goes there. No emulation."""

import lzma
from collections.abc import Sequence
from pathlib import Path

from image.cpio import archive
from image.kernel import Kernel
from image.program import run
from image.tree import Tree

SCRIPT = Path(__file__).parent / "early" / "init"
FOLDERS = ("usr/bin", "dev", "proc", "root", "run", "sys", "modules")


def make(kernel: Kernel, modules: Sequence[str], target: Path) -> None:
    """An initrd, compressed as the kernel reads it; the same files give the same octets. Raises ImageError."""
    tree = contents(kernel.folder / "usr/bin/busybox", kernel.with_dependencies(modules))
    plain = target.with_suffix(".cpio")
    plain.write_bytes(archive(tree))
    run(["zstd", "-q", "-f", "-19", "-T1", "--rm", plain, "-o", target])


def contents(busybox: Path, modules: Sequence[Path]) -> Tree:
    tree = Tree()
    for folder in FOLDERS:
        tree.folder(folder)
    tree.link("bin", "usr/bin")
    tree.write("bin/busybox", busybox.read_bytes(), 0o755)
    tree.write("init", SCRIPT.read_bytes(), 0o755)
    names = []
    for path in modules:
        octets = path.read_bytes()
        # busybox's insmod reads no compressed module.
        names.append(path.name.removesuffix(".xz"))
        tree.write(f"modules/{names[-1]}", lzma.decompress(octets) if path.suffix == ".xz" else octets)
    tree.write("modules/order", "".join(f"{name}\n" for name in names))
    return tree
