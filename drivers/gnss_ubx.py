"""A u-blox receiver of generation 9: its epochs and time marks."""

import logging

from board.errors import InterfaceError, ProtocolError, RequestError
from board.journal import REPEATS, Journal
from board.machine import Machine
from board.time import GPS_LEAD, TimeMark
from drivers.gnss_bringup import Bringup
from drivers.gnss_bus import BusLine
from drivers.gnss_conversation import Conversation
from drivers.gnss_options import GnssOptions
from drivers.gnss_port import Line, SerialLine
from drivers.gnss_receiver import SILENT_S, Above
from drivers.gnss_state import ReceiverState
from drivers.reason import Reason
from drivers.wire import ubx
from drivers.wire.garbage import Garbage
from drivers.wire.gnss_fix import fix_of
from drivers.wire.gnss_stream import GnssStream
from drivers.wire.gnss_time import Pulses, counted
from drivers.wire.ubx_health import MonVer
from drivers.wire.ubx_messages import CfgRst, NavPvt, decode, encode
from drivers.wire.ubx_time import TimTp

log = logging.getLogger("captain.gnss")

# CFG-RST by what an operator asks for. All but `full` keep the configuration.
RESETS = {"hot": CfgRst(0, 2), "warm": CfgRst(1, 2), "cold": CfgRst(0xFFFF, 2), "full": CfgRst(0, 1)}

IN_VAIN = 3  # bring-ups that a receiver acknowledges, and after which it sends no epoch

FRESH_S = 2.0  # an epoch is no reason to trust a pulse for longer

UNKNOWN_NS = 0xFFFF_FFFF  # as NAV-PVT says of a time that it does not know


class UbxReceiver:
    """Brought up by Bringup, supervised by who is above."""

    def __init__(self, options: GnssOptions, machine: Machine, above: Above) -> None:
        self._options = options
        self._machine = machine
        self._above = above
        self._bringup: Bringup | None = None
        self._port: Line | None = None

    def start(self) -> None:
        host = self._above.host
        self._loop = host.loop
        self._state = ReceiverState(Journal(log, host.name, host.loop.clock, REPEATS))
        self._version: MonVer | None = None
        self._refused: list[str] = []
        self._bringups = self._in_vain = self._garbage = 0
        self._epoch_at = float("-inf")  # when the last NAV-PVT came
        port = self._line()
        self._port = port
        self._talk = Conversation(host.loop, port.write)
        host.link(False, f"asking the receiver at {self._options.where} who it is")
        self._bring_up(port)

    def stop(self) -> None:
        if self._bringup is not None:
            self._bringup.close()
            self._bringup = None
        if self._port is not None:
            self._talk.close()
            self._port.close()
            self._port = None

    def silent(self, seconds: float) -> None:
        if self._bringup is not None or self._port is None:
            return
        if self._in_vain == IN_VAIN:
            self._above.failed(self._without_epochs(self._port.path))
            return
        self._above.host.link(False, f"{self._port.path}: no epoch for {SILENT_S:.0f} s; bringing it up anew")
        try:
            self._bring_up(self._port)
        except InterfaceError as error:
            self._above.failed(error)

    def correct(self, frame: bytes) -> None:
        if self._version is not None and self._port is not None:
            self._port.write(frame)

    def reset(self, kind: str) -> None:
        if kind not in RESETS:
            raise RequestError(f"{kind!r} is no reset of a receiver", f"one of {', '.join(RESETS)}")
        if self._port is None or self._version is None:
            raise RequestError("the receiver is not there", "`captain gnss status` says why")
        self._port.write(encode(RESETS[kind]))

    def details(self) -> dict[str, object]:
        version = self._version
        found: dict[str, object] = {"port": self._port.path if self._port else ""}
        if version is not None:
            found |= {"module": version.module, "firmware": version.firmware, "protocol": version.protocol}
        found |= self._state.details()
        if self._options.corrections:
            dropped = self._port.dropped if self._port else 0
            found["corrections"] = {**self._state.corrections(), "dropped": dropped}
        return found | {"refused": self._refused, "bringups": self._bringups, "garbage_octets": self._garbage}

    def _line(self) -> Line:
        loop, options = self._above.host.loop, self._options
        if options.i2c:
            return BusLine(loop, options, self._received, self._above.failed)
        return SerialLine(loop, options, self._machine, self._received, self._above.failed)

    def _bring_up(self, port: Line) -> None:
        self._stream = GnssStream()
        self._pulses = Pulses(1 / self._options.rate_hz)
        self._last_second: int | None = None
        self._bringups += 1
        self._bringup = Bringup(self._loop, self._talk, port, self._options, self._ready, self._above.failed)
        self._bringup.start()

    def _ready(self, version: MonVer) -> None:
        assert self._bringup is not None
        assert self._port is not None
        if self._bringup.refused and self._bringup.refused != self._refused:
            log.warning(
                "%s: firmware %s does not know %s",
                self._above.host.name,
                version.firmware,
                ", ".join(self._bringup.refused),
            )
        self._refused, self._bringup, self._version = self._bringup.refused, None, version
        self._in_vain += 1
        self._above.configured(f"{version.module or 'u-blox receiver'} {version.firmware} at {self._port.path}")

    def _without_epochs(self, path: str) -> InterfaceError:
        text = f"{path}: the receiver was brought up {IN_VAIN} times and sends no epochs"
        if self._options.i2c:
            return InterfaceError(text)
        own = self._options.own_port
        return InterfaceError(text, f"is it at its own port {own}, as receiver_port says, or at another of its ports?")

    def _received(self, octets: bytes) -> None:
        now = self._loop.clock()
        for event in [*self._stream.expire(now), *self._stream.receive(octets, now)]:
            if self._port is None:  # what was told stopped the interface
                return
            match event:
                case ubx.Frame():
                    self._take(event, now)
                case Garbage():
                    self._garbage += event.octets
                    self._above.host.drop(event.reason, event.sample)

    def _take(self, frame: ubx.Frame, now: float) -> None:
        try:
            message = decode(frame)
        except ProtocolError:
            self._above.host.drop(Reason.TRUNCATED, frame.payload)
            return
        if message is None:
            return
        self._talk.hear(message)
        self._state.take(message)
        if isinstance(message, NavPvt):
            self._epoch_at = now
        if self._bringup is not None or self._port is None:
            return
        if isinstance(message, NavPvt):
            self._in_vain = 0
            self._above.epoch(fix_of(message, now))
        elif isinstance(message, TimTp):
            self._mark(message, now)

    def _mark(self, message: TimTp, now: float) -> None:
        """Tell of a pulse, once: at ten epochs a second it is announced ten times."""
        pvt, leap = self._state.pvt, self._state.leap
        pulse = self._pulses.pulse(message, leap, now, None if pvt is None else counted(pvt))
        if pulse.gps == self._last_second and pulse.gps is not None:
            return
        self._last_second = pulse.gps
        is_dated = pvt is not None and pvt.is_date_valid and pvt.is_time_valid
        is_resolved = pvt is not None and pvt.is_fully_resolved and pvt.is_confirmed
        is_fresh = pvt is not None and pvt.fix_type >= 2 and now - self._epoch_at <= FRESH_S
        is_whole = message.tow_ms % 1000 == 0 and message.tow_fraction == 0
        self._above.time_mark(
            TimeMark(
                now,
                pulse.unix if is_resolved else None,
                pvt.time_accuracy_ns if pvt is not None else UNKNOWN_NS,
                message.quantisation_ps if message.is_quantisation_valid else None,
                message.is_locked and is_whole and is_fresh and is_resolved and pulse.unix is not None,
                leap.seconds if leap is not None else None,
                pulse.gps - GPS_LEAD if is_dated and pulse.gps is not None else None,
                leap.announced if leap is not None else None,
            )
        )
