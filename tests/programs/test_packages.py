"""Debian packages in a root: the unit's command, and differences of two states."""

from image.project import version
from tests.programs import packages


def test_command_is_that_of_the_packages_unit_without_placeholders():
    words = packages.command().split()
    assert words == ["/usr/bin/captain", "run", "--config", "/etc/captain/captain.toml", "--board", "none"]


def test_difference_names_what_was_added_removed_or_changed():
    before, after = "/etc/a\n/etc/b\n1  /etc/a\n", "/etc/a\n/etc/c\n2  /etc/a\n"
    assert packages.difference(before, after) == ["/etc/b", "/etc/c", "1  /etc/a", "2  /etc/a"]
    assert packages.difference(before, before) == []


def test_files_of_all_packages_have_the_version_and_their_processor():
    assert packages.names("arm64") == (
        f"captain_{version()}_arm64.deb",
        f"captain-box_{version()}_all.deb",
        f"captain-dev_{version()}_arm64.deb",
    )
