"""The tree of files that becomes a root, and its archives."""

import hashlib
import io
import tarfile
from pathlib import Path

import pytest

from image.errors import ImageError
from image.filesystem.tree import Tree
from image.parts import initrd

EPOCH = 1_750_000_000


def saved(tree: Tree, path: Path) -> dict[str, tarfile.TarInfo]:
    tree.save(path, EPOCH)
    with tarfile.open(path) as archive:
        return {member.name: member for member in archive}


def archived(path: Path, *members: tuple[tarfile.TarInfo, bytes]) -> Path:
    with tarfile.open(path, "w") as archive:
        for head, content in members:
            head.size = len(content)
            archive.addfile(head, io.BytesIO(content))
    return path


def head(name: str, **values: object) -> tarfile.TarInfo:
    found = tarfile.TarInfo(name)
    for key, value in values.items():
        setattr(found, key, value)
    return found


def test_every_file_is_of_one_moment_and_every_folder_comes_before_its_files(tmp_path: Path):
    tree = Tree()
    tree.write("etc/b/c", "text")
    tree.write("etc/a", "text")
    found = saved(tree, tmp_path / "tar")
    assert list(found) == ["etc", "etc/a", "etc/b", "etc/b/c"]
    assert {member.mtime for member in found.values()} == {EPOCH}


def test_an_archives_owners_modes_and_capabilities_are_kept(tmp_path: Path):
    head_ = head(
        "./usr/bin/ping", uid=5, gid=6, mode=0o4755, mtime=1, pax_headers={"SCHILY.xattr.security.capability": "x"}
    )
    with Tree() as tree:
        tree.add_tar(archived(tmp_path / "in", (head_, b"program")))
        found = saved(tree, tmp_path / "tar")["usr/bin/ping"]
        assert (found.uid, found.gid, found.mode, found.size) == (5, 6, 0o4755, 7)
        assert found.pax_headers["SCHILY.xattr.security.capability"] == "x"


def test_a_hard_link_becomes_a_copy_whatever_the_order_of_their_names(tmp_path: Path):
    link = head("./usr/bin/a", type=tarfile.LNKTYPE, linkname="./usr/bin/z", mode=0o755)
    with Tree() as tree:
        tree.add_tar(archived(tmp_path / "in", (head("./usr/bin/z", mode=0o755), b"perl"), (link, b"")))
        assert tree.read("usr/bin/a") == b"perl"
        assert saved(tree, tmp_path / "tar")["usr/bin/a"].isreg()


def test_devices_are_not_taken_as_the_kernel_makes_them(tmp_path: Path):
    with Tree() as tree:
        tree.add_tar(archived(tmp_path / "in", (head("./dev/null", type=tarfile.CHRTYPE), b"")))
        assert "dev/null" not in tree


def test_a_path_below_lib_goes_to_usr_lib_where_debian_has_it():
    tree = Tree()
    tree.write("lib/modules/x", "")
    assert "usr/lib/modules/x" in tree
    assert next(path for path, _ in tree) == "usr"


def test_a_file_in_place_of_a_folder_is_told():
    tree = Tree()
    tree.link("etc/mtab", "../proc/mounts")
    with pytest.raises(ImageError, match="etc/mtab is not a folder in the image"):
        tree.write("etc/mtab/x", "")


def test_removing_takes_what_is_below_and_nothing_that_only_begins_alike():
    tree = Tree()
    for path in ("etc/apt/sources.list", "etc/aptly", "etc/ssh/ssh_host_rsa_key", "etc/ssh/sshd_config"):
        tree.write(path, "")
    tree.remove(["etc/apt", "etc/ssh/ssh_host_*"])
    assert [path for path, entry in tree if entry.head.isreg()] == ["etc/aptly", "etc/ssh/sshd_config"]


def test_a_folder_of_this_machine_comes_as_roots(tmp_path: Path):
    (tmp_path / "a").mkdir()
    (tmp_path / "a/run").write_text("x")
    (tmp_path / "a/run").chmod(0o700)
    (tmp_path / "a/link").symlink_to("run")
    tree = Tree()
    tree.add_folder(tmp_path, "usr/lib/captain")
    found = dict(tree)
    assert found["usr/lib/captain/a/run"].head.mode == 0o755
    assert found["usr/lib/captain/a/link"].head.linkname == "run"
    assert found["usr/lib/captain/a/run"].head.uid == 0


def test_the_same_tree_gives_the_same_octets(tmp_path: Path):
    digests = set()
    for name in ("1", "2"):
        tree = Tree()
        for path in ("b", "a") if name == "1" else ("a", "b"):
            tree.write(path, path)
        tree.save(tmp_path / name, EPOCH)
        digests.add((hashlib.sha256((tmp_path / name).read_bytes()).hexdigest(), initrd.archive(tree)))
    assert len(digests) == 1
