"""Servers of the time, for a box without a receiver."""

import pytest

from board.errors import ConfigurationError
from firmware.box.box_file import BoxOptions, check_server
from firmware.box.system_files import system_files
from pps import chrony_configuration

PLACE = f"{chrony_configuration.SOURCES.removeprefix('/')}/owner.sources"


def test_they_are_laid_where_chronyd_looks_for_them():
    found = system_files(BoxOptions(time_servers=("ptbtime1.ptb.de", "192.0.2.1")), set())
    assert found[PLACE].text == "server ptbtime1.ptb.de iburst\nserver 192.0.2.1 iburst\n"
    assert f"\nsourcedir {chrony_configuration.SOURCES}\n" in chrony_configuration.configuration()


def test_without_any_nothing_is_laid_there():
    assert PLACE not in system_files(BoxOptions(), set())


@pytest.mark.parametrize("text", ["ptbtime1.ptb.de", "ntp", "192.0.2.1", "2001:db8::1", "a.b.c."])
def test_a_host_is_a_name_or_an_address(text: str):
    check_server(text)


@pytest.mark.parametrize(
    "text", ["", "a b", "x iburst\nserver y", "-a.de", "a..b", "192.0.2", "192.0.2.256", "fe80::x", "a." * 140, "a_b"]
)
def test_what_is_none_is_refused(text: str):
    with pytest.raises(ConfigurationError):
        check_server(text)
