"""Simulated receiver: the behaviour on which tests and the simulated board rely."""

import os
import pty
import select
import tty
from contextlib import closing

import pytest

from drivers.sim.receiver.habits import Habits
from drivers.sim.receiver.receiver import Receiver
from drivers.sim.track import BLOCK, Point, Track
from drivers.wire.gnss.fix import METRES
from drivers.wire.gnss.nmea import Sentence
from drivers.wire.gnss.stream import GnssStream
from drivers.wire.ublox import ubx
from drivers.wire.ublox.keys import KEYS
from drivers.wire.ublox.messages import Ack, Nak, NavPvt, decode, encode
from drivers.wire.ublox.ubx import Kind
from drivers.wire.ublox.values import GET_RAM, RAM, ValGet, ValSet
from tests.virtual import VirtualLoop

PATIENCE_S = 0.2  # real seconds for the kernel to carry octets from one end of a pty to the other


class Reader:
    """Program that reads from the receiver's port."""

    def __init__(self, loop, receiver, path=""):
        self.loop = loop
        self.receiver = receiver
        self.stream = GnssStream()
        self.end = os.open(path or receiver.path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)

    def heard(self):
        try:
            return self.stream.receive(os.read(self.end, 65_536), self.loop.now)
        except BlockingIOError:
            return []

    def ask(self, octets):
        """Send octets and return the UBX messages that arrive within 0.1 s."""
        self.heard()
        os.write(self.end, octets)
        usual, self.loop.patience_s = self.loop.patience_s, PATIENCE_S
        self.loop.run_for(0.1)
        self.loop.patience_s = usual
        select.select([self.end], [], [], PATIENCE_S)
        return [decode(event) for event in self.heard() if isinstance(event, ubx.UbxFrame)]

    def close(self):
        os.close(self.end)


@pytest.fixture
def loop():
    with closing(VirtualLoop(patience_s=PATIENCE_S)) as loop:  # the reader reads when it likes
        yield loop


@pytest.fixture
def receiver(loop):
    made = Receiver(loop)
    made.power(True)
    loop.run_until(lambda: made.boots == 1)
    yield made
    made.unplug()


@pytest.fixture
def reader(loop, receiver):
    made = Reader(loop, receiver)
    yield made
    made.close()


def value(name, number):
    return (KEYS[name].number, number)


def test_from_the_factory_it_speaks_nmea_once_a_second(loop, reader):
    loop.run_for(2.5)
    bodies = [event.body for event in reader.heard() if isinstance(event, Sentence)]
    assert [body[2:5] for body in bodies[:4]] == ["GGA", "RMC", "GSA", "VTG"]
    assert len(bodies) == 12


def test_it_takes_all_of_a_configuration_or_nothing(reader, receiver):
    good = ValSet(RAM, (value("CFG-RATE-MEAS", 200),))
    assert reader.ask(encode(good)) == [Ack(6, 0x8A)]
    bad = ValSet(RAM, (value("CFG-RATE-MEAS", 100), (0x2091_0FFF, 1)))
    assert reader.ask(encode(bad)) == [Nak(6, 0x8A)]
    assert receiver.memory.period_ms == 200
    asked = ValGet(0, GET_RAM, (value("CFG-RATE-MEAS", 0),))
    assert reader.ask(encode(asked)) == [ValGet(1, GET_RAM, (value("CFG-RATE-MEAS", 200),)), Ack(6, 0x8B)]


def test_it_answers_polls_of_every_message_that_it_has(reader):
    for kind in (Kind.MON_VER, Kind.NAV_PVT, Kind.NAV_STATUS, Kind.NAV_TIMELS, Kind.MON_RF):
        (answer,) = reader.ask(ubx.encode(kind))
        assert encode(answer)[2:4] == kind.to_bytes(2)


def test_without_power_it_forgets_what_was_for_ram_alone(loop, reader, receiver):
    reader.ask(encode(ValSet(RAM, (value("CFG-RATE-MEAS", 200),))))
    receiver.power(False)
    assert receiver.path == ""
    receiver.power(True)
    loop.run_until(lambda: receiver.boots == 2)
    assert receiver.memory.period_ms == 1000


def test_what_nobody_reads_is_lost_and_does_not_hold_it_up(loop, receiver):
    loop.patience_s = 0.0
    loop.run_for(120)
    assert receiver.boots == 1


def test_it_appears_and_vanishes_with_its_power(loop):
    seen = []
    made = Receiver(loop, appeared=seen.append, vanished=lambda: seen.append("gone"))
    assert made.path == ""
    made.power(True)
    loop.run_for(0.5)
    made.power(False)  # while it boots
    loop.run_for(2)
    assert seen == []
    made.power(True)
    loop.run_for(1)
    path = made.path
    made.unplug()
    made.unplug()
    assert seen == [path, "gone"]


class Gadget:
    """Host's end of a USB gadget's tty, behind a stable name."""

    def __init__(self, path):
        self.path = path

    def plug(self):
        self.end, self._far = pty.openpty()
        tty.setraw(self._far)
        os.set_blocking(self.end, False)
        self.path.symlink_to(os.ttyname(self._far))

    def unplug(self):
        self.path.unlink()
        os.close(self._far)
        os.close(self.end)


def test_at_a_gadget_it_uses_the_tty_that_is_there_whenever_it_is_plugged_in(loop, tmp_path):
    gadget = Gadget(tmp_path / "ttyGS0")
    made = Receiver(loop, Habits(gadget=str(gadget.path)))
    made.power(True)
    for _ in range(2):
        loop.run_for(2)
        gadget.plug()
        loop.run_until(lambda: bool(made.path))
        os.write(gadget.end, ubx.encode(Kind.NAV_PVT))
        loop.run_for(0.1)
        frames = [
            event for event in GnssStream().receive(os.read(gadget.end, 4096), 0.0) if isinstance(event, ubx.UbxFrame)
        ]
        assert isinstance(decode(frames[0]), NavPvt)
        gadget.unplug()
        loop.run_until(lambda: not made.path)
    made.unplug()
    loop.run_for(2)
    assert loop.delay() is None


def test_a_drive_goes_round_at_its_speed():
    track = Track(speed_m_s=10.0)
    first, later = track.at(3.0), track.at(4.0)
    assert abs((later.latitude - first.latitude) * METRES) <= 10.1
    assert first.speed_mm_s == 10_000
    around = track.at(3.0 + track.length_m / 10.0)
    assert abs(around.latitude - first.latitude) <= 1
    still = Track((Point(48.0, 11.0, 400.0),)).at(99.0)
    assert still == (480_000_000, 110_000_000, 400_000, 0, 0, 0.0)
    assert len(BLOCK) == 4
