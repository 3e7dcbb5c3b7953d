"""A tree as a cpio archive, of which Linux makes its first root.

Source: Linux, Documentation/driver-api/early-userspace/buffer-format.rst.
"""

import stat

from image.tree import Tree

_KINDS = {"dir": stat.S_IFDIR, "sym": stat.S_IFLNK, "reg": stat.S_IFREG}


def archive(tree: Tree) -> bytes:
    """Form "newc", every file root's and of 1970: the same tree gives the same octets."""
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
