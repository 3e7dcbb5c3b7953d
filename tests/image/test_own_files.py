"""Forms of our own files: the units of card and Debian package."""

import re
from pathlib import Path

import pytest

from image import own_files
from image.own_files import CARD, PACKAGE
from image.tool import run

UNIT = "usr/lib/systemd/system/captain.service"
MOST_EXPOSED = 2.6  # of systemd's measure: 0 closed, 10 open
# Keys whose values differ: order and folders of the machine, options of the command line. All others are equal.
OF_THE_MACHINE = {
    "After", "Wants", "Requires", "WantsMountsFor", "Environment", "EnvironmentFile", "ExecStart", "WorkingDirectory",
    "StateDirectory", "StateDirectoryMode",
    "SupplementaryGroups",  # a package's user gets groups that exist; systemd starts no unit with an unknown one
    "RestartSteps", "RestartMaxDelaySec",  # unknown to Debian 12's systemd, which reports them at each start
}  # fmt: skip

SERIAL_PORTS = "DeviceAllow=char-tty* rw"  # of all processors; a Pi needs only those that both forms name


def rows(form: str) -> list[str]:
    """Return the unit's settings, `key=value`, in their order."""
    return [line for line in own_files.read(UNIT, form).splitlines() if re.match(r"\w+=", line)]


def test_a_line_is_in_the_form_that_its_mark_names_or_in_both():
    text = "both\n@CARD@ card=1\n@PACKAGE@ package=@BOARD@\n"
    assert own_files.formed(text, CARD) == "both\ncard=1\n"
    assert own_files.formed(text, PACKAGE) == "both\npackage=@BOARD@\n"


def test_mark_alone_on_a_line_is_an_empty_line_of_its_form():
    assert own_files.formed("@CARD@\n  both\n@PACKAGE@", CARD) == "\n  both\n"
    assert own_files.formed("@CARD@\n  both\n@PACKAGE@", PACKAGE) == "  both\n"


def test_no_mark_is_left_in_any_file_of_the_overlay():
    for path in filter(Path.is_file, own_files.OVERLAY.rglob("*")):
        for form in (CARD, PACKAGE):
            text = own_files.read(path.relative_to(own_files.OVERLAY).as_posix(), form)
            assert "@CARD@" not in text
            assert "@PACKAGE@" not in text


def test_units_of_card_and_package_differ_only_in_what_the_machine_determines():
    shared = [[row for row in rows(form) if row.partition("=")[0] not in OF_THE_MACHINE] for form in (CARD, PACKAGE)]
    assert shared[0] == [row for row in shared[1] if row != SERIAL_PORTS]
    assert len(shared[0]) > 50
    differing = {row.partition("=")[0] for row in set(rows(CARD)) ^ set(rows(PACKAGE))}
    assert differing == OF_THE_MACHINE | {"DeviceAllow"}
    assert SERIAL_PORTS in shared[1]


def test_unit_of_the_package_has_no_placeholder_and_no_place_of_the_card():
    text = own_files.read(UNIT, PACKAGE)
    assert not re.search(r"@[A-Z_]{3,}@", text)
    for word in ("/data", "captain-image", "captain-owner", "nftables"):
        assert word not in text


@pytest.mark.parametrize("form", [CARD, PACKAGE])
def test_unit_is_exposed_at_most_as_the_readme_says(form: str, tmp_path: Path):
    path = tmp_path / "captain.service"
    path.write_text(own_files.read(UNIT, form))
    shown = run(["systemd-analyze", "security", "--offline=true", "--no-pager", path])
    found = re.search(r"exposure level for captain\.service: ([0-9.]+)", shown)
    assert found
    assert float(found[1]) <= MOST_EXPOSED
