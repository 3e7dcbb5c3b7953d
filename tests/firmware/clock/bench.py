"""A receiver in its slot, its pulses, and a station's timekeeper, on a clock that jumps; the clocks of its machine may
be wrong, and are stepped.
"""

from dataclasses import replace

import pytest

from board.time.scales import EPOCH, GPS_LEAD, TimeQuality
from firmware.clock.timekeeper import Timekeeper
from firmware.config.tables import TimeOptions
from firmware.station.interfaces import Reports
from firmware.station.signatures import Signatures
from firmware.station.timeline import Timeline
from pps.pulse import Clocks
from tests.firmware.whole_board import WholeBoard
from tests.virtual import VirtualLoop

START_S = 1_795_182_426.25  # Unix time, 2026-11-20
LEAP_SECONDS = 5
PPM = 20.0


class TimeBench:
    """quality: each that was told.

    start_s   Unix time at the start.
    error_ns  by which the system's clock is ahead of the truth.
    """

    def __init__(
        self,
        loop: VirtualLoop,
        patch: pytest.MonkeyPatch,
        options: TimeOptions,
        has_pulse: bool,
        start_s: float = START_S,
    ) -> None:
        self._start_ns = round(start_s * 1e9)
        self.loop = loop
        self.error_ns = 0
        self._began = loop.now
        patch.setattr("time.time", lambda: self.clocks().system_ns / 1e9)
        patch.setattr("firmware.clock.pulsed_time.raw_ns", lambda: self.clocks().raw_ns)
        self.whole = WholeBoard(loop)
        self.own_position = self.whole.own_position
        self.told: list[TimeQuality] = []
        pulse = self.whole.board.pulse if has_pulse else None
        told = self.told.append
        self.keeper = Timekeeper(loop, options, pulse, self.own_position.time, told, self.whole.simulation, self.clocks)
        self._listen()

    def start(self) -> None:
        self.whole.start()
        self.keeper.start(["gnss"])

    def close(self) -> None:
        self.keeper.stop()
        self.whole.close()

    def lose(self, is_lost: bool = True) -> None:
        """The antenna sees no satellites, or does again."""
        receiver = self.whole.module("gnss")
        receiver.sky = replace(receiver.sky, satellites=0 if is_lost else 28)

    def true_ns(self) -> int:
        """ITS time of now."""
        receiver = self.whole.module("gnss")
        return int(receiver.gps_ns(self.loop.now)) - GPS_LEAD * 10**9

    def clocks(self) -> Clocks:
        elapsed_ns = round((self.loop.now - self._began) * 1e9)
        system_ns = self._start_ns + elapsed_ns + self.error_ns
        return Clocks(system_ns, round(elapsed_ns * (1 + PPM / 1e6)), self.loop.now)

    def offset_ns(self) -> int:
        """The truth of what quality.offset_ns is an estimate of."""
        return self.true_ns() + (EPOCH - LEAP_SECONDS) * 10**9 - self.clocks().system_ns

    def state(self) -> str:
        return str(self.keeper.status()["state"])

    def until(self, state: str, within: float = 60.0) -> None:
        self.loop.run_until(lambda: self.state() == state, within)

    def _listen(self) -> None:
        interface = self.whole.gnss.interface
        interface.listener = Reports(
            "gnss", self.own_position, self.keeper, Timeline(self.loop.clock), Signatures("deliver")
        )
