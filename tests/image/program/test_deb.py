"""The Debian package: installed into a root of its own by dpkg, which runs its scripts."""

import gzip
import os
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
    assert f"Depends: libc6 (>= {deb.c_library(program)}), passwd, procps, zlib1g\n" in said
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


def test_installed_it_has_compressed_man_pages_and_completion_of_three_shells(made: Path, root: Path):
    dpkg(root, "--install", made)
    share = root / "usr/share"
    page = (share / "man/man1/captain-listen.1.gz").read_bytes()
    assert page[4:8] == bytes(4)  # no date: equal text gives equal octets
    assert gzip.decompress(page).startswith(b'.TH "CAPTAIN\\-LISTEN" 1 "2025-06-15" "captain 1.2.3"')
    names = (
        "bash-completion/completions/captain",
        "zsh/vendor-completions/_captain",
        "fish/vendor_completions.d/captain.fish",
    )
    assert all((share / name).stat().st_size for name in names)


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
    assert not list((root / "var/lib").glob("captain*"))
    assert (root / "etc/passwd").read_text() == ""
    assert (root / "etc/group").read_text() == "dialout:x:20:\ni2c:x:21:\n"


def test_install_with_a_login_called_captain_is_refused_and_purge_keeps_the_login(made: Path, root: Path):
    login = "captain:x:1000:1000::/home/captain:/bin/bash\n"
    (root / "etc/passwd").write_text(login)
    (root / "etc/group").write_text("captain:x:1000:\nsudo:x:27:captain\n")
    before = (root / "etc/group").read_text()
    with pytest.raises(ImageError, match="uid 1000"):
        dpkg(root, "--install", made)
    assert not (root / "usr/bin/captain").exists()
    dpkg(root, "--purge", "captain")
    assert (root / "etc/passwd").read_text() == login
    assert (root / "etc/group").read_text() == before


def test_purge_with_a_system_user_of_the_machine_keeps_it(made: Path, root: Path):
    user = "captain:x:150:21::/nonexistent:/usr/sbin/nologin\n"
    (root / "etc/passwd").write_text(user)
    dpkg(root, "--install", made)
    assert "captain:x:" in (root / "etc/group").read_text()  # for the unit's Group=
    dpkg(root, "--purge", "captain")
    assert (root / "etc/passwd").read_text() == user
    assert "captain:x:" not in (root / "etc/group").read_text()


def test_purge_with_a_group_of_the_machine_removes_the_user_alone(made: Path, root: Path):
    with (root / "etc/group").open("a") as groups:
        groups.write("captain:x:300:\nnogroup:x:65534:\n")
    before = (root / "etc/group").read_text()
    dpkg(root, "--install", made)
    assert (root / "etc/passwd").read_text().split(":")[3] == "300"
    dpkg(root, "--purge", "captain")
    assert (root / "etc/passwd").read_text() == ""
    assert (root / "etc/group").read_text() == before


def test_purge_with_a_login_that_replaced_the_packages_user_keeps_the_login(made: Path, root: Path):
    dpkg(root, "--install", made)
    login = "captain:x:1000:20::/home/captain:/bin/bash\n"
    (root / "etc/passwd").write_text(login)
    dpkg(root, "--purge", "captain")
    assert (root / "etc/passwd").read_text() == login


def test_purge_that_cannot_remove_the_user_says_so(
    made: Path, root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    dpkg(root, "--install", made)
    busy = tmp_path / "bin/userdel"
    busy.parent.mkdir()
    busy.write_text("#!/bin/sh\nexit 8\n")
    busy.chmod(0o755)
    monkeypatch.setenv("PATH", f"{busy.parent}:{os.environ['PATH']}")
    assert "captain: user captain stays: stop its programs" in dpkg(root, "--purge", "captain")
    monkeypatch.undo()
    dpkg(root, "--install", made)
    dpkg(root, "--purge", "captain")
    assert (root / "etc/passwd").read_text() == ""  # the record of what the package created was kept


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
