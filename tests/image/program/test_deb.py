"""The Debian package: installed into a root of its own by dpkg, which runs its scripts."""

import shutil
import stat
from pathlib import Path

import pytest

from image.errors import ImageError
from image.program import deb
from image.tool import run
from tests.image.program.conftest import MACHINE, dpkg, package


def test_the_same_program_gives_the_same_octets(program: Path, made: Path, tmp_path: Path):
    assert package(program, tmp_path / "again.deb").read_bytes() == made.read_bytes()


def test_everything_in_it_is_roots_and_nothing_may_be_written_by_others(made: Path):
    rows = run(["dpkg-deb", "--contents", made]).splitlines()
    assert {row.split()[1] for row in rows} == {"root/root"}
    modes = {row.split()[0] for row in rows}
    assert modes == {"drwxr-xr-x", "-rwxr-xr-x", "-rw-r--r--", "lrwxrwxrwx"}


def test_it_says_what_it_is_and_which_c_library_it_needs(program: Path, made: Path):
    said = run(["dpkg-deb", "--field", made])
    assert f"Package: captain\nVersion: 1.2.3\nArchitecture: {MACHINE}\n" in said
    assert f"Depends: libc6 (>= {deb.c_library(program)}), passwd, procps\n" in said
    assert deb.c_library(program).startswith("2.")


def test_a_program_that_asks_for_no_c_library_is_told(tmp_path: Path):
    with pytest.raises(ImageError, match="has no program"):
        deb.c_library(tmp_path)


def test_installed_it_runs_has_its_unit_and_its_user(made: Path, root: Path):
    dpkg(root, "--install", made)
    assert run([root / "usr/bin/captain"]) == "captain 1.2.3\n"
    assert (root / "usr/lib/systemd/system/captain.service").exists()
    user = (root / "etc/passwd").read_text().split(":")
    assert (user[0], user[5:]) == ("captain", ["/var/lib/captain", "/usr/sbin/nologin\n"])
    groups = {line.split(":")[0]: line.split(":")[3] for line in (root / "etc/group").read_text().splitlines()}
    assert groups == {"dialout": "captain", "i2c": "captain", "captain": ""}
    shadow = (root / "etc/shadow").read_text()
    assert shadow.startswith("captain:!")  # no password


def test_it_is_installed_whole(made: Path, root: Path):
    dpkg(root, "--install", made)
    assert dpkg(root, "--verify", "captain") == ""


def test_an_update_keeps_what_the_owner_has_written(program: Path, made: Path, root: Path, tmp_path: Path):
    dpkg(root, "--install", made)
    (root / "etc/captain/captain.toml").write_text("# mine\n")
    dpkg(root, "--install", package(program, tmp_path / "new.deb", "1.3.0"))
    assert (root / "etc/captain/captain.toml").read_text() == "# mine\n"
    assert (root / "etc/passwd").read_text().count("\n") == 1


def test_removed_it_leaves_the_owners_files_and_purged_none(made: Path, root: Path):
    dpkg(root, "--install", made)
    (root / "var/lib/captain").mkdir()
    dpkg(root, "--remove", "captain")
    assert (root / "etc/captain/captain.toml").exists()
    assert not (root / "usr/lib/captain").exists()
    dpkg(root, "--purge", "captain")
    assert not (root / "etc/captain").exists()
    assert not (root / "var/lib/captain").exists()
    assert (root / "etc/passwd").read_text() == ""
    assert (root / "etc/group").read_text() == "dialout:x:20:\ni2c:x:21:\n"


@pytest.mark.parametrize("path", [path for name in deb.SCRIPTS for path in sorted(deb.FILES.rglob(name))])
def test_a_script_is_one_of_the_shell_that_every_debian_has(path: Path):
    text = path.read_text()
    assert text.startswith("#!/bin/sh\n")
    assert "set -e\n" in text
    run(["sh", "-n", path])
    if shutil.which("dash"):
        run(["dash", "-n", path])


def test_scripts_are_run_and_files_of_the_owner_are_named(made: Path, tmp_path: Path):
    run(["dpkg-deb", "--control", made, tmp_path])
    assert {path.name for path in tmp_path.iterdir()} == {"control", "conffiles", "md5sums", *deb.SCRIPTS}
    assert (tmp_path / "conffiles").read_text() == "/etc/captain/captain.toml\n/etc/default/captain\n"
    for name in deb.SCRIPTS:
        assert stat.S_IMODE((tmp_path / name).stat().st_mode) == 0o755
