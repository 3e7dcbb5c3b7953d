"""A board file: every table may be left out, and every name in one of them must mean something in another."""

from pathlib import Path

import pytest

from board.runtime.errors import ConfigurationError
from firmware.config import board_file
from firmware.config.board_file import BOARDS, Board
from tests.said import tells

WHOLE = """
name = "mine"
[buses.main]
path = "/dev/i2c-1"
[expanders.pins]
bus = "main"
address = 0x20
[lines.v2x_power]
expander = "pins"
pin = 3
initial = "active"
[lines.v2x_reset]
chip = "pinctrl-bcm2711"
offset = 17
active_low = true
open_drain = true
[rails.main]
kind = "ina219"
bus = "main"
min_v = 4.75
[temperatures.board]
kind = "tmp102"
bus = "main"
[temperatures.cpu]
kind = "thermal"
source = "cpu-thermal"
max_c = 80
[fan]
hwmon = "pwmfan"
[identity]
bus = "main"
[slots.v2x]
title = "ITS-G5"
usb = "1-1.3"
power = "v2x_power"
reset = "v2x_reset"
[slots.free]
usb = "1-1.2"
hub_port = true
"""


def read(folder: Path, text: str) -> Board:
    path = folder / "mine.toml"
    path.write_text(text)
    return board_file.load(str(path))


def mistakes(folder: Path, text: str) -> list[str]:
    with pytest.raises(ConfigurationError) as caught:
        read(folder, text)
    where = f"{folder}/mine.toml: "
    lines = str(caught.value).splitlines()
    assert all(line.startswith(where) for line in lines)
    return [line.removeprefix(where) for line in lines]


def test_a_whole_board_is_read(tmp_path: Path) -> None:
    board = read(tmp_path, WHOLE)
    assert board.lines["v2x_power"].pin == 3
    assert board.expanders["pins"].address == 0x20
    assert (board.rails["main"].min_v, board.rails["main"].max_a) == (4.75, None)
    assert board.temperatures["cpu"].max_c == 80.0
    assert board.fan is not None
    assert board.identity is not None
    assert list(board.slots) == ["v2x", "free"]


def test_a_name_is_all_that_a_board_must_have(tmp_path: Path) -> None:
    board = read(tmp_path, 'name = "bare"\n')
    assert (board.slots, board.fan, board.simulated) == ({}, None, False)


@pytest.mark.parametrize("path", sorted(BOARDS.glob("*.toml")), ids=lambda path: path.stem)
def test_a_board_that_ships_has_no_mistake_and_says_what_it_is(path: Path) -> None:
    board = board_file.load(path.stem)
    assert board.name == path.stem
    assert board.description


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            'expander = "pins"',
            'expander = "pin"',
            "lines.v2x_power.expander: 'pin' is not declared; did you mean pins?",
        ),
        ('[expanders.pins]\nbus = "main"', '[expanders.pins]\nbus = "mian"', "expanders.pins.bus: 'mian' is not decl"),
        ('[rails.main]\nkind = "ina219"\nbus = "main"', '[rails.main]\nkind = "ina219"\nbus = "x"', "rails.main.bus: "),
        ('kind = "tmp102"\nbus = "main"', 'kind = "tmp102"\nbus = "x"', "temperatures.board.bus: 'x' is not declared"),
        ('[identity]\nbus = "main"', '[identity]\nbus = "x"', "identity.bus: 'x' is not declared; known: main"),
        ('power = "v2x_power"', 'power = "v2x_powr"', "slots.v2x.power: 'v2x_powr' is not declared; did you mean"),
        ('reset = "v2x_reset"', 'reset = "v2x"', "slots.v2x.reset: 'v2x' is not declared"),
        (
            'reset = "v2x_reset"',
            'reset = "v2x_power"',
            "slots.v2x.reset: 'v2x_power' is also the power line of the slot",
        ),
        ('usb = "1-1.2"\n', "", "slots.free.usb: is missing; a hub can switch"),
        ('usb = "1-1.2"', 'usb = "1-1.3"', "slots.free.usb: '1-1.3' is already used by v2x"),
        ("hub_port = true", 'power = "v2x_power"', "slots.free.power: 'v2x_power' is already used by v2x"),
        ('kind = "ina219"\nbus = "main"', 'kind = "ina219"', "rails.main: a rail is read by one of bus and hwmon"),
        ('kind = "ina219"\n', 'kind = "ina219"\nhwmon = "ina219"\n', "rails.main: a rail is read by one of bus and"),
        ('kind = "tmp102"\nbus = "main"', 'kind = "tmp102"', "temperatures.board: only a tmp102 has a bus"),
        ('source = "cpu-thermal"', "", "temperatures.cpu.source: is missing; give the name of the thermal device"),
        ('source = "cpu-thermal"', 'bus = "main"', "temperatures.cpu: only a tmp102 has a bus"),
        (
            'chip = "pinctrl-bcm2711"\noffset = 17',
            'expander = "pins"\npin = 3',
            "lines.v2x_reset.pin: 'pins 3' is already used by",
        ),
        ('chip = "pinctrl-bcm2711"', "", "lines.v2x_reset: a line has one of chip, line and expander"),
        ("address = 0x20", "address = 0x40", "rails.main.address: 0x40 of main is already used by expanders.pins"),
        ("min_v = 4.75", "min_v = 9\nmax_v = 3", "rails.main: min_v 9 is more than max_v 3"),
        ('usb = "1-1.3"', 'usb = "banana"', "slots.v2x.usb: 'banana'"),
        ('usb = "1-1.3"', 'usb = "1-1.3"\nids = ["x"]', "slots.v2x.ids[0]: invalid id of a USB device: 'x'"),
        ("address = 0x20", "address = 0x78", "expanders.pins.address: 120 is "),
        ("pin = 3", "pin = 16", "lines.v2x_power.pin: 16 is "),
    ],
)
def test_a_mistake_is_named_with_its_place_and_what_to_do(tmp_path: Path, old: str, new: str, said: str) -> None:
    assert old in WHOLE
    (mistake,) = mistakes(tmp_path, WHOLE.replace(old, new, 1))
    assert mistake.startswith(said)


@pytest.mark.parametrize(
    ("pulse", "where"),
    [
        ('device = "/dev/pps0"', "/dev/pps0"),
        ('chip = "gpiochip0"\noffset = 18\nedge = "falling"', "gpiochip0 line 18"),
        ('line = "GPIO18"\nlatency_ns = 4000\ninterface = "gnss"', "GPIO18"),
        ('kind = "simulated"', "simulated"),
    ],
)
def test_a_pulse_comes_to_one_input(tmp_path: Path, pulse: str, where: str) -> None:
    simulated = f"simulated = {str('simulated' in pulse).lower()}\n"
    board = read(tmp_path, f"{simulated}{WHOLE}[pulse]\n{pulse}\n")
    assert board.pulse is not None
    assert board.pulse.where == where


@pytest.mark.parametrize(
    ("pulse", "said"),
    [
        ("", "pulse: needs one of device, chip, line and kind"),
        ('device = "/dev/pps0"\nline = "GPIO18"', "pulse: needs one of device, chip, line and kind"),
        ('device = "/dev/pps0"\noffset = 18', "pulse.offset: is that of a line in a chip"),
        ('chip = "gpiochip0"', "pulse.offset: is missing; give that of the line"),
        ('line = "GPIO18"\ngpio = 18', "pulse.gpio: is that of a PPS device; give the device"),
        ('device = "/dev/pps0"\ngpio = 28', "pulse.gpio: 28 is "),
        ('device = "/dev/p\\u001b[31mps"', "pulse.device: '/dev/p\\x1b[31mps' has characters that cannot be printed"),
        ('device = "/dev/pps0\\u0000"', "pulse.device: '/dev/pps0\\x00' has characters that cannot be printed"),
        ('kind = "simulated"', "pulse.kind: simulated pulses need a simulated board"),
        ('chip = "pinctrl-bcm2711"\noffset = 17', "pulse: 'pinctrl-bcm2711 17' is already used by lines.v2x_reset"),
        ('devise = "/dev/pps0"', "pulse.devise: is not a known key; did you mean device?"),
        ('device = "/dev/pps0"\nedge = "up"', 'pulse.edge: "up" is not a choice'),
        ('device = "/dev/pps0"\nlatency_ns = -1', "pulse.latency_ns: -1 is "),
    ],
)
def test_a_pulse_that_cannot_be_is_a_mistake(tmp_path: Path, pulse: str, said: str) -> None:
    (mistake,) = mistakes(tmp_path, f"{WHOLE}[pulse]\n{pulse}\n")
    assert mistake.startswith(said)


def test_all_mistakes_are_named_at_once(tmp_path: Path) -> None:
    wrong = WHOLE.replace('power = "v2x_power"', 'power = "a"').replace('reset = "v2x_reset"', 'reset = "b"')
    assert len(mistakes(tmp_path, wrong)) == 2


def test_a_mistake_of_one_key_hides_none_of_another_and_none_between_tables(tmp_path: Path) -> None:
    wrong = (
        WHOLE.replace('expander = "pins"', 'expander = "pins"\noffset = "x"\nchip = "gpiochip0"')
        .replace("address = 0x20", "address = 0x78")
        .replace('usb = "1-1.3"', 'usb = "banana"\nids = ["x"]\nwait = 3')
        .replace('[slots.free]\nusb = "1-1.2"', '[slots.free]\npower = "v2x_powr"')
        .replace('[identity]\nbus = "main"', '[identity]\nbus = "mian"')
    )
    assert [mistake.split(": ")[0] for mistake in mistakes(tmp_path, wrong)] == [
        "lines.v2x_power.offset",
        "expanders.pins.address",
        "slots.v2x.wait",
        "slots.v2x.usb",
        "slots.v2x.ids[0]",
        "lines.v2x_power",
        "identity.bus",
        "slots.free.power",
        "slots.free.usb",
    ]


def test_what_has_a_mistake_of_its_own_is_declared_all_the_same(tmp_path: Path) -> None:
    (mistake,) = mistakes(tmp_path, WHOLE.replace('path = "/dev/i2c-1"', "path = 1"))
    assert mistake.startswith("buses.main.path: 1 is an integer")


def test_source_that_is_misspelt_is_one_mistake(tmp_path: Path) -> None:
    (mistake,) = mistakes(tmp_path, WHOLE.replace('chip = "pinctrl-bcm2711"', 'chp = "pinctrl-bcm2711"'))
    assert tells(mistake, "lines.v2x_reset.chp: ", "not a known key; ", "chip?")


@pytest.mark.parametrize("part", ["lines", "buses", "slots", "rails", "identity", "fan", "pulse"])
@pytest.mark.parametrize("value", ["5", "[]", "{}", "{ x = 5 }"])
def test_a_part_that_is_no_table_is_explained(tmp_path: Path, part: str, value: str) -> None:
    try:
        read(tmp_path, f'name = "a"\n{part} = {value}\n')
    except ConfigurationError as error:
        assert part in error.message


def test_channels_of_one_chip_may_be_rails_of_their_own(tmp_path: Path) -> None:
    chip = 'kind = "ina3221"\nbus = "main"\naddress = 0x41\nchannel = {}\n'
    rails = [f"[rails.r{number}]\n{chip.format(number)}" for number in (1, 2)]
    assert len(read(tmp_path, WHOLE + "".join(rails)).rails) == 3
    again = f"[rails.r3]\n{chip.format(1)}"
    (mistake,) = mistakes(tmp_path, WHOLE + "".join([*rails, again]))
    assert tells(mistake, "rails.r3.address: 0x41 ", "main", "used", "rails.r1; ")


def test_a_name_where_none_is_declared_says_which_table_to_add(tmp_path: Path) -> None:
    (mistake,) = mistakes(tmp_path, 'name = "a"\n[expanders.x]\nbus = "mian"\naddress = 0x20\n')
    assert mistake == "expanders.x.bus: 'mian' is not declared; add a table [buses.mian]"


def test_what_tables_have_to_do_with_each_other_is_told_with_mistakes_in_the_same_tables(tmp_path: Path) -> None:
    text = """
name = "x"
[buses.main]
path = "/dev/i2c-1"
[expanders.switches]
bus = "mein"
address = 0x99
[lines.a]
expander = "swich"
pin = "2"
[rails.main]
kind = "ina226"
bus = "main"
address = "x"
min_v = 13.0
max_v = 11.0
[identity]
bus = "maim"
address = "y"
[slots.a]
usb = "1-1.3"
power = "zz"
wait_s = "a"
[slots.b]
usb = "1-1.3"
settle_s = "b"
"""
    told = [line.partition(": ")[0] for line in mistakes(tmp_path, text)]
    types = ["lines.a.pin", "expanders.switches.address", "rails.main.address", "identity.address"]
    types += ["slots.a.wait_s", "slots.b.settle_s"]
    names = ["expanders.switches.bus", "lines.a.expander", "identity.bus", "slots.a.power", "slots.b.usb", "rails.main"]
    assert sorted(told) == sorted(types + names)
