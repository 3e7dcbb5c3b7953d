"""The early boot: its archive, which Linux unpacks."""

from image.filesystem.tree import Tree
from image.parts import initrd


def test_a_cpio_archive_is_what_the_kernel_unpacks():
    tree = Tree()
    tree.write("init", "#!/bin/sh\n", 0o755)
    tree.link("bin", "usr/bin")
    octets = initrd.archive(tree)
    # Form "newc": 6 octets of magic and 13 numbers of 8 hexadecimal digits; inode 1, mode of a link, 7 octets.
    assert octets[:22] == b"070701" + b"00000001" + b"0000a1ff"
    assert octets[110:124] == b"bin\0\0\0usr/bin\0"[:14]
    assert octets.endswith(b"TRAILER!!!\0\0\0\0")
    assert len(octets) % 4 == 0
