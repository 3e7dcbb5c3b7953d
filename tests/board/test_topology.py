"""Places of USB devices: text of a board file, paths of sysfs, and which slot a device belongs to."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from board.runtime.errors import ConfigurationError
from board.topology import MOST_LEVELS, MOST_PORTS, Topology, holder, of_devpath, parse

PORTS = st.lists(st.integers(1, MOST_PORTS), min_size=1, max_size=MOST_LEVELS).map(tuple)
PLACES = st.builds(Topology, st.integers(1, 999), PORTS)

# As `readlink -f /sys/class/tty/ttyUSB2` shows it on a Pi 4 with the modem behind two hubs.
TTY = (
    "/devices/platform/scb/fd500000.pcie/pci0000:00/0000:00:00.0/0000:01:00.0/usb1/1-1/1-1.2/1-1.2.3/1-1.2.3:1.2"
    "/ttyUSB2/tty/ttyUSB2"
)
# A Qualcomm gadget behind dummy_hcd, a root hub of its own.
GADGET = "/devices/platform/dummy_hcd.0/usb3/3-1/3-1:1.0/net/usb0"


@given(place=PLACES)
def test_a_place_is_read_as_it_is_written(place):
    assert parse(str(place)) == place


@given(text=st.text(max_size=12) | st.text("0123456789.-: \n", max_size=12))
def test_any_text_is_a_place_as_it_is_written_or_refused_with_a_remedy(text):
    try:
        place = parse(text)
    except ConfigurationError as error:
        assert repr(text) in error.message
        assert error.hint
    else:
        assert str(place) == text


@pytest.mark.parametrize(
    "text",
    [
        "",
        "1",
        "1-",
        "-1",
        "1-0",
        "0-1",
        "01-1",
        "1-1.",
        "1-.1",
        "1.1-1",
        "usb1",
        "1-1:1.0",
        " 1-1",
        "1-1\n",
        "1-0050",
        "1-١",
    ],
)
def test_what_is_no_place_is_refused(text):
    with pytest.raises(ConfigurationError, match="is not the place of a USB device"):
        parse(text)


def test_more_hubs_or_ports_than_usb_has_are_refused():
    with pytest.raises(ConfigurationError, match="7 levels of ports"):
        parse("1-1.1.1.1.1.1.1")
    with pytest.raises(ConfigurationError, match="port 32"):
        parse("1-1.32")


@pytest.mark.parametrize(
    ("text", "hub", "interface", "port"),
    [
        ("1-1.3", "1-1", "1-1:1.0", 3),
        ("2-1.2.4", "2-1.2", "2-1.2:1.0", 4),
        ("1-2", "usb1", "1-0:1.0", 2),
    ],
)
def test_a_place_is_a_port_of_a_hub(text, hub, interface, port):
    place = parse(text)
    assert (place.hub, place.hub_interface, place.port) == (hub, interface, port)


def test_a_place_holds_itself_and_what_is_behind_it():
    place = parse("1-1.3")
    assert place.holds(parse("1-1.3"))
    assert place.holds(parse("1-1.3.1"))


@pytest.mark.parametrize("other", ["1-1", "1-1.30", "1-1.2", "2-1.3", "1-1.2.3"])
def test_a_place_holds_nothing_else(other):
    assert not parse("1-1.3").holds(parse(other))


@pytest.mark.parametrize(
    ("devpath", "text"),
    [
        (TTY, "1-1.2.3"),
        (TTY.rpartition("/1-1.2.3/")[0], "1-1.2"),
        ("/sys" + TTY, "1-1.2.3"),
        (GADGET, "3-1"),
    ],
)
def test_the_device_of_a_path_is_the_last_one_in_it(devpath, text):
    assert str(of_devpath(devpath)) == text


@pytest.mark.parametrize(
    "devpath",
    [
        "",
        "/devices/platform/soc/fe804000.i2c/i2c-1/1-0050",  # the 24C32 of a HAT
        "/devices/virtual/net/1-1",
        "/devices/pci0000:00/usb1",
        "/devices/pci0000:00/usb1/1-0:1.0",
        "/devices/pci0000:00/usb1/1-1.1.1.1.1.1.1.1",
        "/module/usbserial",
    ],
)
def test_a_path_without_a_usb_device_has_none(devpath):
    assert of_devpath(devpath) is None


@given(text=st.text() | st.text("/usb1-.:0"))
def test_any_path_has_a_place_or_none(text):
    place = of_devpath(text)
    assert place is None or str(place) in text


def test_a_device_belongs_to_the_slot_it_is_in_or_behind():
    slots = {"gnss": "1-1.1", "v2x": "1-1.2", "5g": "1-1.3", "free": ""}
    assert holder(parse("1-1.3"), slots) == "5g"
    assert holder(parse("1-1.3.2"), slots) == "5g"
    assert holder(parse("1-1.30"), slots) is None
    assert holder(parse("1-1"), slots) is None


def test_the_nearest_of_two_slots_behind_each_other_has_it():
    assert holder(parse("1-1.2.1"), {"inner": "1-1.2", "outer": "1-1"}) == "inner"
