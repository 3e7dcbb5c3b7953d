"""Chips on I2C: registers to values, computed by hand from the data sheets, and what goes over the bus for it."""

import errno
from itertools import count, pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from board.chips import eeprom, expander, power, temperature
from board.runtime.errors import InterfaceError, RequestError
from drivers.sim.chips import Fault, SimulatedBus
from drivers.sim.registers import Eeprom, Expander, Ina, Tmp102, Words

PINS = st.integers(0, 15)


def bus_with(chip, address=0x40):
    return SimulatedBus("/dev/i2c-1", {address: chip})


def writes(bus):
    return [write for _, write, read in bus.seen if not read]


# expander


class WatchedExpander(Expander):
    """Notes the levels at all pins after each transaction."""

    def __init__(self):
        super().__init__()
        self.history = [self.levels]

    def transfer(self, write, read):
        found = super().transfer(write, read)
        self.history.append(self.levels)
        return found


@given(pin=PINS, is_high=st.booleans())
def test_a_pin_gets_its_level_before_it_becomes_an_output(pin, is_high):
    bus = bus_with(Expander())
    expander.set_level(bus, 0x40, pin, is_high)
    registers = [write[0] for write in writes(bus)]
    # At power-on all latches are high: a high one need not be written.
    assert registers == ([6 + pin // 8] if is_high else [2 + pin // 8, 6 + pin // 8])


@given(
    latches=st.integers(0, 0xFFFF), inputs=st.integers(0, 0xFFFF), pin=PINS, is_high=st.booleans(), drain=st.booleans()
)
def test_no_other_pin_moves_and_the_pin_itself_moves_once(latches, inputs, pin, is_high, drain):
    chip = WatchedExpander()
    chip.hold(bytes(2) + latches.to_bytes(2, "little") + bytes(2) + inputs.to_bytes(2, "little"))
    chip.history = [chip.levels]
    expander.set_level(bus_with(chip), 0x40, pin, is_high, drain)
    before, after = chip.history[0], chip.history[-1]
    assert after[pin] == is_high
    assert [level for other, level in enumerate(after) if other != pin] == [
        level for other, level in enumerate(before) if other != pin
    ]
    assert sum(sooner != later for sooner, later in pairwise(chip.history)) == (before[pin] != is_high)


def test_what_others_have_set_is_read_from_the_chip_and_stays():
    chip = Expander()
    bus = bus_with(chip)
    expander.set_level(bus, 0x40, 0, False)
    chip.transfer(bytes([2, 0b1010_1010]), 0)  # somebody else
    expander.set_level(bus, 0x40, 1, False)
    assert chip.registers[2] == 0b1010_1000


def test_a_pin_that_is_as_wanted_is_not_written():
    bus = bus_with(Expander())
    for _ in range(2):
        expander.set_level(bus, 0x40, 12, False)
    assert writes(bus) == [bytes([3, 0xEF]), bytes([7, 0xEF])]


def test_open_drain_drives_low_and_lets_go_for_high():
    chip = Expander()
    bus = bus_with(chip)
    expander.set_level(bus, 0x40, 9, False, open_drain=True)
    assert (chip.registers[3], chip.registers[7]) == (0xFD, 0xFD)
    expander.set_level(bus, 0x40, 9, True, open_drain=True)
    assert (chip.registers[3], chip.registers[7]) == (0xFD, 0xFF)
    chip.outside[9] = False  # the module holds it itself
    expander.set_level(bus, 0x40, 9, True, open_drain=True)
    assert not expander.level(bus, 0x40, 9)


def test_a_pin_that_does_not_follow_is_a_fault_with_both_levels():
    chip = Expander()
    chip.outside[5] = True
    with pytest.raises(InterfaceError, match="pin 5 of 0x20 on /dev/i2c-1: set low, but reads high") as caught:
        expander.set_level(bus_with(chip, 0x20), 0x20, 5, False)
    assert "shorted" in caught.value.hint


def test_a_level_is_read_past_an_inverted_polarity():
    chip = Expander()
    chip.registers[5] = 0x01
    assert expander.level(bus_with(chip), 0x40, 8)
    expander.set_level(bus_with(chip), 0x40, 8, False)
    assert not chip.levels[8]


def test_a_chip_that_does_not_keep_its_registers_is_said_to_be_another():
    with pytest.raises(InterfaceError, match="register 2 reads 0x00 after 0x01 was written") as caught:
        expander.set_level(bus_with(Words({0: 0})), 0x40, 0, True)
    assert "PCA9555" in caught.value.hint


# power


@pytest.mark.parametrize(("kind", "registers", "shunt_ohm", "channel", "volts", "amps"), [
    # SBOS448: bits 15 to 3 of the bus register are units of 4 mV: 3000 is 12 V; 4000 shunt units of 10 uV are 40 mV
    ("ina219", {0: 0x399F, 1: 0x0FA0, 2: 3000 << 3 | 2}, 0.1, 1, 12.0, 0.4),
    ("ina219", {0: 0x399F, 1: 0xF060, 2: 3000 << 3 | 2}, 0.1, 1, 12.0, -0.4),
    ("ina219", {0: 0x399F, 1: 0x8300, 2: 0xFA02}, 0.1, 1, 32.0, -3.2),  # the ends of both ranges: 32 V, -320 mV
    # SBOS547, the example of section 6.5.1: 11.98 V, and 20 mV over 2 mohm
    ("ina226", {0: 0x4527, 1: 0x1F40, 2: 0x2570}, 0.002, 1, 11.98, 10.0),
    ("ina226", {0: 0x4527, 1: 0xFFFF, 2: 0x0000}, 0.0025, 1, 0.0, -0.001),
    # SBOS576: bits 15 to 3: 625 units of 8 mV are 5 V; 80 mV is 0x3E80, -80 mV is 0xC180
    ("ina3221", {0: 0x7127, 3: 0x3E80, 4: 625 << 3}, 0.1, 2, 5.0, 0.8),
    ("ina3221", {0: 0x7127, 5: 0xC180, 6: 625 << 3}, 0.1, 3, 5.0, -0.8),
    ("ina3221", {0: 0x7127, 1: 0x0008, 2: 0x0008}, 0.04, 1, 0.008, 0.001),
])  # fmt: skip
def test_power_is_what_the_data_sheet_says_of_the_registers(kind, registers, shunt_ohm, channel, volts, amps):
    found = power.read(bus_with(Words(registers)), 0x40, kind, shunt_ohm, channel)
    assert found == pytest.approx((volts, amps, volts * amps), rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("kind", power.KINDS)
def test_a_chip_is_configured_where_it_is_not_and_only_there(kind):
    chip = Ina(kind, [0.01, 0.01, 0.01] if kind == "ina3221" else [0.01])
    chip.registers[0] = 0
    bus = bus_with(chip)
    power.read(bus, 0x40, kind, 0.01)
    power.read(bus, 0x40, kind, 0.01)
    assert writes(bus) == [b"\0" + power.KINDS[kind].configuration.to_bytes(2, "big")]


@pytest.mark.parametrize("kind", power.KINDS)
@given(volts=st.floats(0, 26), amps=st.floats(-8, 8), channel=st.integers(1, 3))
def test_what_a_simulated_chip_measures_is_read_within_its_resolution(kind, volts, amps, channel):
    channels = 3 if kind == "ina3221" else 1
    chip = Ina(kind, [0.01] * channels)
    chip.loads[(channel - 1) % channels] = (volts, amps)
    found = power.read(bus_with(chip), 0x40, kind, 0.01, (channel - 1) % channels + 1)
    assert found.volts == pytest.approx(volts, abs=8e-3)
    assert found.amps == pytest.approx(amps, abs=40e-6 / 0.01)


def test_chip_of_another_kind_is_refused_with_the_kind_to_declare():
    with pytest.raises(InterfaceError, match="0x40 on /dev/i2c-1 is an INA3221, not an INA226") as caught:
        power.read(bus_with(Ina("ina3221", [0.1] * 3)), 0x40, "ina226", 0.1)
    assert 'kind = "ina3221"' in caught.value.hint


def test_a_chip_that_does_not_keep_its_configuration_is_not_believed():
    with pytest.raises(InterfaceError, match="configuration 0x399f reads back as 0x60a0"):
        power.read(bus_with(Stubborn({0: 0x60A0})), 0x40, "ina219", 0.1)


class Stubborn(Words):
    def store(self, register, word):
        pass


def test_a_conversion_that_never_ends_is_given_up():
    clock = count(0.0, 0.05)
    with pytest.raises(InterfaceError, match="no conversion within"):
        power.read(bus_with(Words({0: 0})), 0x40, "ina219", 0.1, clock=lambda: next(clock))


# temperature


@pytest.mark.parametrize(("digits", "celsius"), [
    # SBOS397, table 2
    (0x7FF, 127.9375), (0x640, 100.0), (0x190, 25.0), (0x004, 0.25), (0x000, 0.0),
    (0xFFC, -0.25), (0xE70, -25.0), (0xC90, -55.0),
])  # fmt: skip
def test_twelve_bits_of_temperature(digits, celsius):
    assert temperature.read(bus_with(Words({0: digits << 4, 1: 0x60A0})), 0x40) == celsius


@pytest.mark.parametrize(("digits", "celsius"), [
    # SBOS397, table 3
    (0x0960, 150.0), (0x0800, 128.0), (0x0190, 25.0), (0x0004, 0.25), (0x1FFC, -0.25), (0x1E70, -25.0), (0x1C90, -55.0),
])  # fmt: skip
def test_thirteen_bits_of_temperature_in_extended_mode(digits, celsius):
    assert temperature.read(bus_with(Words({0: digits << 3 | 1, 1: 0x60B0})), 0x40) == celsius


@given(celsius=st.floats(-55, 127), is_extended=st.booleans())
def test_a_simulated_sensor_is_read_within_its_resolution(celsius, is_extended):
    chip = Tmp102()
    chip.celsius = celsius
    chip.registers[1] |= is_extended << 4
    assert temperature.read(bus_with(chip), 0x40) == pytest.approx(celsius, abs=0.0625)


def test_a_sensor_that_sleeps_is_woken_and_its_old_value_not_told():
    chip = Tmp102()
    chip.registers[1] |= 1 << 8
    with pytest.raises(InterfaceError, match="was in shutdown mode, and is started"):
        temperature.read(bus_with(chip), 0x40)
    assert temperature.read(bus_with(chip), 0x40) == 25.0


# EEPROM


def test_an_eeprom_is_read_by_an_address_of_sixteen_bits():
    chip = Eeprom(bytes(range(256)) * 16)
    bus = bus_with(chip)
    assert eeprom.read(bus, 0x40, 0x0123, 4) == bytes([0x23, 0x24, 0x25, 0x26])
    assert list(bus.seen) == [(0x40, b"\x01\x23", bytes([0x23, 0x24, 0x25, 0x26]))]


@given(offset=st.integers(0, 4000), octets=st.binary(max_size=96))
def test_what_is_written_is_read_whatever_pages_it_crosses_and_nothing_else_changes(offset, octets):
    chip = Eeprom(bytes(4096))
    eeprom.write(bus_with(chip), 0x40, offset, octets, clock=lambda: 0.0)  # a cycle is as long as the chip says
    assert chip.memory == bytearray(offset) + octets + bytes(4096 - offset - len(octets))


def test_no_write_crosses_a_page():
    bus = bus_with(Eeprom())
    eeprom.write(bus, 0x40, 30, bytes(40))
    assert [(int.from_bytes(write[:2], "big"), len(write) - 2) for write in writes(bus) if len(write) > 2] == [
        (30, 2), (32, 32), (64, 6),
    ]  # fmt: skip


def test_nothing_is_written_beyond_the_end():
    bus = bus_with(Eeprom())
    with pytest.raises(RequestError, match="3 octets at 4094 do not fit"):
        eeprom.write(bus, 0x40, 4094, b"abc")
    assert not bus.seen


def test_a_protected_eeprom_is_found_out_although_it_acknowledges():
    chip = Eeprom()
    chip.is_protected = True
    with pytest.raises(InterfaceError, match="2 octets at 64 differ from the written ones") as caught:
        eeprom.write(bus_with(chip), 0x40, 64, b"ab")
    assert "WP" in caught.value.hint


def test_a_page_that_is_never_written_is_given_up():
    clock = count(0.0, 0.005)
    with pytest.raises(InterfaceError, match=r"timeout of a page write after 0\.02 s: no answer from 0x40"):
        eeprom.write(bus_with(Eeprom(busy=1000)), 0x40, 0, b"a", clock=lambda: next(clock))


# faults of a simulated bus


def test_an_address_without_a_chip_does_not_answer():
    with pytest.raises(InterfaceError, match="no answer from 0x41 on /dev/i2c-1"):
        bus_with(Tmp102()).transfer(0x41, b"\0", 2)


def test_a_fault_comes_at_its_transaction_and_goes():
    bus = bus_with(Tmp102())
    bus.faults[0x40] = Fault(errno.EIO, after=1, times=1)
    bus.transfer(0x40, b"\0", 2)
    with pytest.raises(InterfaceError, match="Input/output error"):
        bus.transfer(0x40, b"\0", 2)
    bus.transfer(0x40, b"\0", 2)


def test_a_stuck_bus_blocks_for_its_time_and_then_says_so():
    blocked = []
    bus = SimulatedBus("/dev/i2c-1", {0x40: Tmp102()}, block=blocked.append)
    bus.faults[0x40] = Fault(errno.ETIMEDOUT, seconds=1.0)
    with pytest.raises(InterfaceError, match="the bus is stuck"):
        bus.transfer(0x40, b"\0", 2)
    assert blocked == [1.0]


@pytest.mark.parametrize("after", range(8))
def test_a_transfer_that_fails_in_the_middle_of_setting_a_pin_leaves_all_others_and_can_be_repeated(after):
    chip = Expander()
    bus = bus_with(chip)
    bus.faults[0x40] = Fault(errno.EIO, after=after, times=1)
    try:
        expander.set_level(bus, 0x40, 3, False)
    except InterfaceError:
        assert all(level for pin, level in enumerate(chip.levels) if pin != 3)
        expander.set_level(bus, 0x40, 3, False)
    assert [pin for pin, level in enumerate(chip.levels) if not level] == [3]
