"""Stage for pi-gen: its files, and what its scripts do in the card's root."""

import os
import subprocess
from pathlib import Path

import pytest

from tests.image.conventions.mirrors import PACKAGES, STAGE

PREAMBLE = """
on_chroot() { cat >>"$CALLS"; }
copy_previous() { echo copied >>"$CALLS"; }
export -f on_chroot copy_previous
"""


def run(script: Path, folder: Path, **environment: str) -> list[str]:
    """Run a script as pi-gen does, in its folder; return the lines for the chroot."""
    calls = folder / "calls"
    calls.touch()
    words = {**os.environ, "CALLS": str(calls), "ROOTFS_DIR": str(folder / "root"), **environment}
    subprocess.run(["bash", "-c", f'{PREAMBLE}cd "$1"; "$2"', "run", folder, script.resolve()], env=words, check=True)
    return calls.read_text().splitlines()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """As a sub-stage with packages in files/."""
    (tmp_path / "files").mkdir()
    for name in PACKAGES:
        (tmp_path / "files" / name).touch()
    return tmp_path


def test_files_of_the_stage_have_the_names_that_pi_gen_runs_and_scripts_are_executable():
    found = {path.relative_to(STAGE).as_posix() for path in STAGE.rglob("*") if path.is_file()}
    assert found == {"EXPORT_IMAGE", "prerun.sh", "00-captain/00-packages", "00-captain/01-run.sh"}
    assert all(path.stat().st_mode & 0o111 for path in STAGE.rglob("*.sh"))
    assert (STAGE / "00-captain/00-packages").read_text().split() == ["chrony"]


@pytest.mark.parametrize(
    ("environment", "board"),
    [({}, '--board "quad" --pi "4"'), ({"CAPTAIN_BOARD": "pi", "CAPTAIN_PI": "5"}, '--board "pi" --pi "5"')],
)
def test_stage_installs_the_packages_and_sets_the_card_up(folder: Path, environment: dict[str, str], board: str):
    assert run(STAGE / "00-captain/01-run.sh", folder, **environment) == [
        "apt-get install --yes /var/cache/captain/*.deb",
        f"captain box setup --write {board}",
        "rm -r /var/cache/captain",
    ]
    assert sorted(path.name for path in (folder / "root/var/cache/captain").iterdir()) == sorted(PACKAGES)


def test_stage_without_packages_fails(tmp_path: Path):
    with pytest.raises(subprocess.CalledProcessError):
        run(STAGE / "00-captain/01-run.sh", tmp_path)


def test_prerun_copies_the_previous_stage_once(tmp_path: Path):
    assert run(STAGE / "prerun.sh", tmp_path) == ["copied"]
    (tmp_path / "root").mkdir()
    assert run(STAGE / "prerun.sh", tmp_path) == ["copied"]
