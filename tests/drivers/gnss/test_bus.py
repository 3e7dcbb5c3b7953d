"""A receiver at an I2C bus, with the process that asks it."""

import sys
from pathlib import Path

import pytest

from board.runtime.errors import InterfaceError
from drivers.gnss import ublox
from drivers.gnss.bus import EARLY, BusLine
from drivers.gnss.driver import ZedF9p
from drivers.gnss.options import GnssOptions
from drivers.sim.receiver.habits import Habits
from drivers.sim.receiver.receiver import Receiver
from tests.drivers.host import SHARED
from tests.drivers.test_contract import sources
from tests.said import tells

PROGRAM = [sys.executable, "-P", str(Path(__file__).with_name("bus_program.py"))]


@pytest.fixture
def receiver(loop):
    made = Receiver(loop, Habits(port="i2c"))
    made.power(True)
    loop.run_until(lambda: made.boots == 1)
    yield made
    made.unplug()


@pytest.fixture
def driver(loop, receiver, monkeypatch):
    """The interface, whose process is that of bus_program.py."""

    class Line(BusLine):
        def __init__(self, *arguments):
            super().__init__(*arguments, command=PROGRAM)

    monkeypatch.setattr(ublox, "BusLine", Line)
    made = []

    def make(**options):
        made.append(ZedF9p(GnssOptions(i2c=receiver.path, rate_hz=1, **options), SHARED))
        return made[-1]

    yield make
    loop.patience_s = 20.0
    for one in made:
        one.stop()
        loop.run_until(lambda: sources(loop) == bool(receiver.path))  # its process has ended


def test_it_is_configured_and_gives_fixes_by_its_registers(driver, loop, host, receiver):
    one = driver()
    loop.patience_s = 20.0  # a process has to start
    one.start(host)
    loop.run_until(lambda: receiver.requests or host.failures)
    loop.patience_s = 0.1  # and to look
    loop.run_until(lambda: host.failures or any(fix.latitude is not None for fix in host.fixes))
    assert host.failures == []
    assert host.is_up
    assert receiver.memory.value("CFG-I2COUTPROT-NMEA") == 0
    assert receiver.memory.value("CFG-MSGOUT-UBX_NAV_PVT_I2C") == 1


def test_a_chip_that_does_not_answer_is_named(driver, loop, host, receiver):
    one = driver(i2c_address=0x43)
    loop.patience_s = 20.0
    one.start(host)
    loop.run_until(lambda: bool(host.failures))
    assert isinstance(host.failures[0], InterfaceError)
    assert host.failures[0].message == f"no answer from 0x43 on {receiver.path}"
    assert host.failures[0].hint == "is it fitted?"


def test_bus_that_breaks_while_it_is_used_is_a_fault(driver, loop, host, receiver):
    one = driver()
    loop.patience_s = 20.0
    one.start(host)
    loop.run_until(lambda: receiver.requests or host.failures)
    receiver.unplug()
    loop.run_until(lambda: bool(host.failures))
    (failure,) = host.failures
    assert tells(failure.message, "bus", "stuck")


def test_what_is_written_before_the_process_runs_waits_and_the_oldest_of_too_much_is_counted(loop):
    line = BusLine(loop, GnssOptions(i2c="/dev/i2c-1"), print, print)
    for number in range(EARLY):
        line.write(bytes((number,)))
    assert line.dropped == 0
    line.write(b"more")
    line.write(b"and more")
    assert line.dropped == 2
    assert line.path == "/dev/i2c-1"
