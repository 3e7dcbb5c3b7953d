"""board/i2c.py, its chips and hwmon on I2C buses of the kernel: i2c-stub, which knows SMBus alone, and one that knows all.

The second is an MCP2221, a bridge from USB HID to I2C: the kernel's own driver for it, the device itself played here.
"""

from collections.abc import Iterator
from pathlib import Path

import pytest

from board import hwmon, identity
from board.chips import eeprom, expander, power, temperature
from board.description import TemperatureDescription
from board.i2c import Bus
from board.runtime.errors import InterfaceError
from board.runtime.loop import Loop
from drivers.sim.chips import SimulatedBus
from drivers.sim.registers import Eeprom, Expander, Tmp102, hat_image
from tests.proof.kernel.checks.kernel import Hotplug, Seen, load, run, until
from tests.proof.kernel.checks.mcp2221 import Mcp2221

EXPANDER, POWER, TEMPERATURE, EEPROM, NOBODY = 0x20, 0x40, 0x48, 0x50, 0x21
DEVICES = Path("/sys/bus/i2c/devices")


@pytest.fixture(scope="module")
def stub() -> Iterator[str]:
    """Path of a bus with memory at the addresses: what is written to a register is read back from it."""
    load("i2c-dev")
    load("i2c-stub", chip_addr=",".join(map(hex, (EXPANDER, POWER, TEMPERATURE, EEPROM))))
    (path,) = (path for path in DEVICES.glob("i2c-*") if "stub" in (path / "name").read_text())
    yield f"/dev/{path.name}"
    run("modprobe", "-r", "i2c-stub")


@pytest.fixture
def bus(stub: str) -> Iterator[Bus]:
    opened = Bus(stub)
    yield opened
    opened.close()


def test_an_expander_drives_its_pins_by_smbus(bus: Bus, seen: Seen) -> None:
    bus.transfer(EXPANDER, bytes([expander.DIRECTION + 1, 0xFF]), 0)
    bus.transfer(EXPANDER, bytes([expander.INPUT + 1, 1 << 3]), 0)  # memory only: the pin follows the register
    expander.set_level(bus, EXPANDER, 11, True)
    assert bus.transfer(EXPANDER, bytes([expander.DIRECTION + 1]), 1) == bytes([0xFF & ~(1 << 3)])
    assert expander.level(bus, EXPANDER, 11)
    with pytest.raises(InterfaceError) as stuck:
        expander.set_level(bus, EXPANDER, 11, False)
    seen(f"pin 11 is an output, high; {stuck.value.message}")


def test_power_and_temperature_are_measured_by_smbus(bus: Bus, seen: Seen) -> None:
    kind = power.KINDS["ina219"]
    for register, word in ((power.CONFIGURATION, kind.configuration), (1, 1000), (2, (1250 << 3) | 2)):
        bus.transfer(POWER, bytes([register]) + word.to_bytes(2, "big"), 0)
    bus.transfer(TEMPERATURE, bytes([temperature.TEMPERATURE]) + (0x1900).to_bytes(2, "big"), 0)
    bus.transfer(TEMPERATURE, bytes([temperature.CONFIGURATION]) + (0x60A0).to_bytes(2, "big"), 0)
    measured = power.read(bus, POWER, "ina219", shunt_ohm=0.01)
    assert measured == pytest.approx((5.0, 1.0, 5.0))
    celsius = temperature.read(bus, TEMPERATURE)
    assert celsius == 25.0
    seen(f"{measured.volts} V, {measured.amps} A, {celsius} C")


def test_what_smbus_has_not_is_refused_by_name(bus: Bus, seen: Seen) -> None:
    with pytest.raises(InterfaceError) as refused:
        eeprom.read(bus, EEPROM, 0, 16)
    seen(refused.value.message)


def test_nobody_answers_where_nobody_is(bus: Bus, seen: Seen) -> None:
    with pytest.raises(InterfaceError) as refused:
        bus.transfer(NOBODY, b"\0", 1)
    assert "no answer from 0x21" in refused.value.message
    seen(refused.value.message)


def test_a_chip_of_the_kernel_is_left_alone_and_read_by_hwmon(stub: str, bus: Bus, seen: Seen) -> None:
    load("tmp102")
    bus.transfer(TEMPERATURE, bytes([temperature.TEMPERATURE]) + (0x1900).to_bytes(2, "big"), 0)
    device = DEVICES / Path(stub).name
    (device / "new_device").write_text(f"tmp102 {TEMPERATURE:#x}")
    try:
        with pytest.raises(InterfaceError) as taken:
            temperature.read(bus, TEMPERATURE)
        loop = Loop()
        until(loop, lambda: _by_hwmon() is not None)
        loop.close()
        celsius = _by_hwmon()  # its driver takes 13 bits, and so the word of 25 degrees for 50
        assert celsius == 50.0
    finally:
        (device / "delete_device").write_text(f"{TEMPERATURE:#x}")
    seen(f"{taken.value.message}; {taken.value.hint}; hwmon: {celsius} C")


def _by_hwmon() -> float | None:
    """None while its driver has no value yet."""
    try:
        return hwmon.temperature(Path("/sys"), TemperatureDescription(kind="hwmon", source="tmp102"))
    except InterfaceError:
        return None


@pytest.fixture(scope="module")
def bridge() -> Iterator[Mcp2221]:
    """A bus that knows all of I2C, with simulated chips."""
    image = hat_image("captain", "Quad Expander", 1, 2, "d9f3a1c4-5e60-4b7a-9c2d-0123456789ab")
    chips = {EXPANDER: Expander(), TEMPERATURE: Tmp102(), EEPROM: Eeprom(image)}
    load("i2c-dev")
    # While the driver of Linux 6.1 starts, it takes no answer, and waits 4 s for each of six.
    loop = Loop()
    hotplug = Hotplug(loop)
    with Mcp2221(SimulatedBus("simulated", chips)) as made:
        until(loop, lambda: "bind hid" in hotplug.told)
        hotplug.close()
        loop.close()
        yield made


@pytest.fixture
def whole(bridge: Mcp2221) -> Iterator[Bus]:
    opened = Bus(bridge.path)
    yield opened
    opened.close()


def test_a_combined_transaction_has_no_stop_in_it(bridge: Mcp2221, whole: Bus, seen: Seen) -> None:
    expander.set_level(whole, EXPANDER, 11, False)
    assert not expander.level(whole, EXPANDER, 11)
    assert bridge.transfers[-1] == (EXPANDER, bytes([expander.POLARITY + 1]), 1)
    celsius = temperature.read(whole, TEMPERATURE)
    assert bridge.transfers[-1] == (TEMPERATURE, bytes([temperature.TEMPERATURE]), 2)
    seen(f"a register is written and read in one I2C_RDWR: pin 11 low, {celsius} C")


def test_the_identity_is_read_from_an_eeprom(whole: Bus, seen: Seen) -> None:
    octets = eeprom.read(whole, EEPROM, 0, identity.ENOUGH)
    found = identity.of_eeprom(octets, whole.path)
    assert (found.vendor, found.product) == ("captain", "Quad Expander")
    seen(f"{len(octets)} octets behind a word address: {found.vendor} {found.product}, {found.uuid}")


def test_who_does_not_answer_is_told(whole: Bus, seen: Seen) -> None:
    for write, read in ((b"\0", 1), (b"\0\0", 0), (b"", 1)):
        with pytest.raises(InterfaceError) as refused:
            whole.transfer(NOBODY, write, read)
        assert "no answer from 0x21" in refused.value.message
    seen(refused.value.message)
