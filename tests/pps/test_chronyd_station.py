"""Time path of a station in virtual time, with a real chronyd.

Pulses, announcements and epochs go in. Samples from the station's end of the socket go to chronyd with their offset,
and with a stamp of its own moment. So minutes of the station are part of a second of chronyd.
"""

import socket
import struct
from collections.abc import Iterator
from contextlib import ExitStack, closing
from pathlib import Path

import pytest

from board.time.scales import LeapEvent
from firmware.clock.own_time import OwnTime
from firmware.clock.pulsed_time import PulsedTime
from pps.pulse import Clocks, Pulse
from tests.pps.chronyd import STAMPED_AGO_NS, Chronyd, shift_to
from tests.pps.receiver import LEAPS, MONOTONIC, RAW_NS, START, Said, fix, mark, pulse, unix_s
from tests.virtual import VirtualLoop

SAMPLE = struct.Struct("@qqdiiii")
PPM = -12.0  # of the oscillator
SETTLED_S = 10e-6
LASTING = 5


class Daemon:
    """A station's time before its own machine, whose system clock is `ahead_ns` of the truth."""

    def __init__(self, folder: Path, chronyd: Chronyd) -> None:
        self.ahead_ns = 0
        self.leap: LeapEvent | None = None
        self.second = 0
        self._chronyd = chronyd
        self._loop = VirtualLoop(now=MONOTONIC)
        self._far = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
        self._far.bind(str(folder / "station.sock"))
        self._near = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
        own = OwnTime(self._loop.clock)
        self.time = PulsedTime(self._loop, "gnss", None, 0, str(folder / "station.sock"), own, self._clocks)

    def __call__(self) -> None:
        """One more second of the station."""
        self.second += 1
        told = mark(self.second, leap_event=self.leap)
        edge = pulse(self.second, ppm=PPM, system_ns=self.ahead_ns)
        for said in (
            Said(self.second - 0.9, told),
            Said(self.second, edge),
            Said(self.second + 0.05, fix(self.second)),
        ):
            self._loop.run_for(said.at + MONOTONIC - self._loop.now)
            match said.what:
                case Pulse():
                    self.time.pulse(said.what)
                case _ if said.what is told:
                    self.time.mark(told)
                case _:
                    self.time.fix(fix(self.second))
        self._pass_on()

    def close(self) -> None:
        self.time.stop()
        self._far.close()
        self._near.close()
        self._loop.close()

    def _clocks(self) -> Clocks:
        gone_ns = round((self._loop.now - MONOTONIC) * 1e9)
        raw_ns = RAW_NS + round(gone_ns * (1 + PPM * 1e-6))
        return Clocks(unix_s(START, LEAPS) * 10**9 + gone_ns + self.ahead_ns, raw_ns, self._loop.now)

    def _pass_on(self) -> None:
        try:
            _, _, *rest = SAMPLE.unpack(self._far.recv(100))
        except BlockingIOError:
            return  # it is still acquiring
        stamp_us = (self._chronyd.clocks().system_ns - STAMPED_AGO_NS) // 1000
        self._near.sendto(SAMPLE.pack(*divmod(stamp_us, 10**6), *rest), str(self._chronyd.socket))


@pytest.fixture
def closing_all() -> Iterator[ExitStack]:
    with ExitStack() as stack:
        yield stack


def test_chronyd_follows_what_the_pulses_show_of_the_clock(closing_all: ExitStack, tmp_path: Path) -> None:
    chronyd = closing_all.enter_context(Chronyd(tmp_path))
    daemon = closing_all.enter_context(closing(Daemon(tmp_path, chronyd)))

    chronyd.until(daemon, lambda state: state.reference == "PPS")
    for ahead_ns in (0, 500_000, 0, -500_000):
        daemon.ahead_ns = ahead_ns
        state = chronyd.until(
            daemon, lambda state: abs(state.system_offset_s + daemon.ahead_ns / 1e9) < SETTLED_S, LASTING
        )
        assert state.stratum == 1
    samples = daemon.time.status()["refclock"]
    assert isinstance(samples, dict)
    assert samples["feeds"]
    assert set(samples["samples"]) == {"sent"}


@pytest.mark.parametrize(("now", "said"), [("2030-12-31T12:00:00", "Insert second"), ("2030-12-30T12:00:00", "Normal")])
def test_a_leap_second_that_the_receiver_announces_reaches_chronyd(
    closing_all: ExitStack, tmp_path: Path, now: str, said: str
) -> None:
    chronyd = closing_all.enter_context(Chronyd(tmp_path, shift_s=shift_to(now)))
    daemon = closing_all.enter_context(closing(Daemon(tmp_path, chronyd)))
    daemon.leap = LeapEvent(START + 40_000, 1)

    chronyd.until(daemon, lambda state: state.leap == said, LASTING)
