"""Early boot: static busybox, modules for the root, and a script."""

import lzma
import stat
from collections.abc import Sequence
from pathlib import Path

from image.filesystem.tree import Tree
from image.parts.kernel import Kernel
from image.tool import run

SCRIPT = Path(__file__).parents[1] / "early" / "init"
FOLDERS = ("usr/bin", "dev", "proc", "root", "run", "sys", "modules")
_KINDS = {"dir": stat.S_IFDIR, "sym": stat.S_IFLNK, "reg": stat.S_IFREG}


def make(kernel: Kernel, modules: Sequence[str], target: Path) -> None:
    """Make an initrd, compressed for the kernel; equal files give equal octets. Raises ImageError if zstd fails."""
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
        # busybox's insmod cannot read compressed modules.
        names.append(path.name.removesuffix(".xz"))
        tree.write(f"modules/{names[-1]}", lzma.decompress(octets) if path.suffix == ".xz" else octets)
    tree.write("modules/order", "".join(f"{name}\n" for name in names))
    return tree


def archive(tree: Tree) -> bytes:
    """Return a tree as the cpio archive from which Linux makes its first root.

    The format is "newc". All files belong to root and are dated 1970, so equal trees give equal octets.
    Source: Linux, Documentation/driver-api/early-userspace/buffer-format.rst.
    """
    found = bytearray()
    for number, (path, entry) in enumerate(tree, start=1):
        kind = "dir" if entry.head.isdir() else "sym" if entry.head.issym() else "reg"
        content = entry.head.linkname.encode() if kind == "sym" else entry.content()
        found += _record(path, number, _KINDS[kind] | entry.head.mode, content)
    return bytes(found + _record("TRAILER!!!", 0, 0, b""))


def _record(path: str, number: int, mode: int, content: bytes) -> bytes:
    name = path.encode() + b"\0"
    #      inode   mode  uid gid links mtime size          major, minor of the file and of a device  name       check
    head = (number, mode, 0, 0, 1, 0, len(content), 0, 0, 0, 0, len(name), 0)
    return _padded(b"070701" + b"".join(b"%08x" % value for value in head) + name) + _padded(content)


def _padded(octets: bytes) -> bytes:
    return octets + bytes(-len(octets) % 4)
