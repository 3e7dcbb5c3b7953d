"""GPIO lines: found by label, name or path, set, read back, and every way in which one cannot be had."""

import errno
import os
import sys

import pytest

from board.description import LineDescription
from board.line import Lines, OutputLine
from board.runtime.errors import InterfaceError
from tests.board.gpio import Drive, Gpio
from tests.said import tells

PI = "pinctrl-bcm2711"


@pytest.fixture
def gpio(monkeypatch, tmp_path):
    return Gpio(monkeypatch, tmp_path)


def line(**description):
    return LineDescription(**{"chip": PI, "offset": 5, "initial": "inactive"} | description)


@pytest.mark.parametrize("chip", ["gpiochip1", PI])
def test_a_chip_is_found_by_name_and_by_label_whatever_its_number(gpio, tmp_path, chip):
    gpio.add("gpiochip0", "raspberrypi-exp-gpio")
    pi = gpio.add("gpiochip1", PI)
    OutputLine(line(chip=chip), tmp_path)
    assert pi.users == {5: "captain"}


def test_a_chip_is_found_by_its_path(gpio, tmp_path):
    pi = gpio.add("gpiochip0", PI)
    OutputLine(line(chip=str(tmp_path / "gpiochip0")))
    assert pi.users == {5: "captain"}


def test_a_line_is_found_by_the_name_that_the_kernel_gives_it(gpio, tmp_path):
    gpio.add("gpiochip0", "other", names=["A"])
    pi = gpio.add("gpiochip1", PI, names=["ID_SDA", "ID_SCL", "GPIO2"])
    OutputLine(line(chip="", line="GPIO2"), tmp_path)
    assert pi.users == {2: "captain"}


def test_a_link_to_a_chip_is_not_a_second_chip(gpio, tmp_path):
    pi = gpio.add("gpiochip4", PI)
    (tmp_path / "gpiochip0").symlink_to("gpiochip4")
    OutputLine(line(), tmp_path)
    assert pi.users == {5: "captain"}


@pytest.mark.parametrize(("description", "level"), [
    ({"initial": "active"}, True), ({"initial": "inactive"}, False),
    ({"initial": "active", "active_low": True}, False), ({"initial": "inactive", "active_low": True}, True),
])  # fmt: skip
def test_a_line_begins_as_its_description_says_without_being_anything_else_before(gpio, tmp_path, description, level):
    pi = gpio.add("gpiochip0", PI)
    OutputLine(line(**description), tmp_path)
    assert pi.changes == [(5, "output", Drive.PUSH_PULL, level)]


def test_a_kept_line_is_left_alone_until_it_is_set_and_then_begins_with_that_level(gpio, tmp_path):
    pi = gpio.add("gpiochip0", PI)
    kept = OutputLine(line(initial="keep"), tmp_path)
    assert pi.changes == [(5, "as is", None, None)]
    kept.set(True)
    kept.set(False)
    assert pi.changes[1:] == [(5, "output", Drive.PUSH_PULL, True), (5, "set", Drive.PUSH_PULL, False)]


def test_an_open_drain_line_is_asked_for_as_such(gpio, tmp_path):
    pi = gpio.add("gpiochip0", PI)
    reset = OutputLine(line(open_drain=True, active_low=True), tmp_path)
    assert pi.changes == [(5, "output", Drive.OPEN_DRAIN, True)]
    reset.set(True)
    assert pi.levels[5] is False


def test_what_a_line_is_can_be_read_back(gpio, tmp_path):
    gpio.add("gpiochip0", PI)
    one = OutputLine(line(active_low=True), tmp_path)
    assert not one.is_active
    one.set(True)
    assert one.is_active


def test_a_line_that_does_not_follow_is_a_fault_with_both_states(gpio, tmp_path):
    pi = gpio.add("gpiochip0", PI)
    one = OutputLine(line(), tmp_path)
    pi.outside[5] = False
    with pytest.raises(InterfaceError, match="pinctrl-bcm2711, line 5: set active, but reads inactive") as caught:
        one.set(True)
    assert "shorted" in caught.value.hint


def test_an_open_drain_line_that_another_holds_low_is_no_fault_and_one_that_is_held_high_is(gpio, tmp_path):
    pi = gpio.add("gpiochip0", PI)
    reset = OutputLine(line(open_drain=True, active_low=True), tmp_path)
    pi.outside[5] = False
    reset.set(False)
    assert reset.is_active
    pi.outside[5] = True
    with pytest.raises(InterfaceError, match="set active, but reads inactive"):
        reset.set(True)


@pytest.mark.parametrize(("number", "words", "hint"), [
    (errno.EACCES, "Permission denied", "adduser USER gpio"),
    (errno.ENODEV, "No such device", "gpiodetect"),
    (errno.ENOTTY, "Inappropriate ioctl", "gpiodetect"),
])  # fmt: skip
def test_a_chip_that_cannot_be_opened_is_named_with_what_to_do(gpio, tmp_path, number, words, hint):
    gpio.add("gpiochip0", PI).failure = OSError(number, os.strerror(number))
    with pytest.raises(InterfaceError, match=f"pinctrl-bcm2711, line 5: {words}") as caught:
        OutputLine(line(), tmp_path)
    assert hint in caught.value.hint


def test_a_line_that_another_has_is_said_with_its_user(gpio, tmp_path):
    gpio.add("gpiochip0", PI).users[5] = "reset-modem"
    with pytest.raises(InterfaceError, match="line 5: in use by reset-modem") as caught:
        OutputLine(line(), tmp_path)
    assert "gpioinfo" in caught.value.hint


def test_a_closed_line_is_free_and_as_it_was(gpio, tmp_path):
    pi = gpio.add("gpiochip0", PI)
    one = OutputLine(line(initial="active"), tmp_path)
    one.close()
    one.close()
    assert (pi.users, pi.levels) == ({}, {5: True})


@pytest.mark.parametrize(("description", "words"), [
    ({"chip": "gpiochip7"}, "gpiochip7, line 5: No such file or directory"),
    ({"chip": "pinctrl-rp1"}, "no GPIO chip is labelled pinctrl-rp1"),
    ({"chip": "", "line": "GPIO99"}, "no line of any GPIO chip is named GPIO99"),
    ({"offset": 58}, "pinctrl-bcm2711, line 58: line offset"),
])  # fmt: skip
def test_what_is_not_there_is_named(gpio, tmp_path, description, words):
    gpio.add("gpiochip0", PI, names=["GPIO0"])
    with pytest.raises(InterfaceError, match=words) as caught:
        OutputLine(line(**description), tmp_path)
    assert "gpioinfo" in caught.value.hint


@pytest.mark.parametrize("module", ["gpiod", "gpiod.line"])  # the second: version 1, of Debian 12
def test_without_version_two_of_gpiod_a_line_says_what_is_needed(gpio, tmp_path, monkeypatch, module):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(InterfaceError, match="libgpiod version 2 is needed") as caught:
        OutputLine(line(), tmp_path)
    assert "pip install gpiod" in caught.value.hint


# Lines


@pytest.fixture
def lines(gpio, tmp_path):
    gpio.add("gpiochip0", PI)
    lines = Lines(
        {
            "radio": line(offset=1, initial="active"),
            "modem": line(chip="absent", offset=2),
            "far": LineDescription(expander="slots", pin=3),
        },
        tmp_path,
    )
    lines.open()
    yield lines
    lines.close()


def test_all_lines_of_the_pi_are_opened_once_and_held(lines, gpio, tmp_path):
    pi = gpio.chips[str(tmp_path / "gpiochip0")]
    assert pi.users == {1: "captain"}
    assert ("radio" in lines, "modem" in lines, "far" in lines) == (True, True, False)
    lines.set("radio", False)
    assert not lines.is_active("radio")
    lines.close()
    assert pi.users == {}


def test_line_of_an_absent_chip_is_a_fault_of_that_line_alone(lines):
    assert list(lines.faults) == ["modem"]
    assert tells(str(lines.faults["modem"]), "line modem: ", "no GPIO chip", "absent")
    lines.set("radio", True)


def test_a_line_that_comes_later_is_had_when_it_is_set(lines, gpio):
    with pytest.raises(InterfaceError, match="labelled absent"):
        lines.set("modem", True)
    chip = gpio.add("gpiochip1", "absent")
    lines.set("modem", True)
    assert (chip.levels, lines.faults) == ({2: True}, {})


def test_a_line_that_does_not_follow_is_in_the_faults_until_it_does(lines, gpio, tmp_path):
    pi = gpio.chips[str(tmp_path / "gpiochip0")]
    pi.outside[1] = True
    with pytest.raises(InterfaceError, match="reads active"):
        lines.set("radio", False)
    assert "radio" in lines.faults
    pi.outside.clear()
    lines.set("radio", False)
    assert "radio" not in lines.faults
