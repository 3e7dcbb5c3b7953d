"""UBX receiver: brings a u-blox of generation 9 up, then passes on its epochs and time marks.

State table:

# state        meaning                                    event                          -> state
#
# identifying  MON-VER at rate_baud, then FACTORY_BAUD    version received at rate_baud     configuring
#                                                         version received at FACTORY_BAUD  changing
#                                                         no answer at either rate          failed
# changing     rate_baud was set in the receiver          CHANGE_S expires                  identifying at rate_baud
# configuring  a group of keys was sent                   ACK of the last group             saving
#                                                         NAK of several keys               configuring by halves
#                                                         NAK of one key that is needed     failed; another is skipped
#                                                         no answer                         failed
# saving       keys are compared with flash, if `save`    all keys are saved or were tried  ready
# ready        waits for the first epoch                  NAV-PVT                           up
#                                                         SILENT_S without an epoch         identifying
# up           epochs and time marks are passed on        SILENT_S without an epoch         identifying
# any          the port fails, or IN_VAIN bring-ups without an epoch -> failed. stop() -> closed

RunningReceiver (running.py) calls start() and stop() on the loop. It calls silent() every LOOK_S while no epoch has
arrived for SILENT_S; during a bring-up silent() does nothing. The source of corrections calls correct(), the driver
calls reset(). Each question has a limited number of tries, so a bring-up always ends. failed() may be called in any
state, also inside start(). After STUCK failures without an epoch, RunningReceiver asks for a power cycle.

The link comes up with the first epoch, not with the last acknowledgement. Earlier, a receiver on USB with
receiver_port = "uart2" acknowledged everything but sent no epochs, and its link was reported up every few seconds.

The acknowledgement of a new baud rate arrives at the old rate, at the new one, or not at all. It is not awaited;
instead the receiver is identified again. Only one question is sent at a time (conversation.py). An acknowledgement does
not name its question. Therefore, after a repeated question, the next one waits wait_s for a possible second answer.
Flash wears out, so it is read first, and only keys that differ are written.
"""

import logging

from board.machine import Machine
from board.runtime.errors import InterfaceError, ProtocolError, RequestError
from board.runtime.journal import REPEATS, Journal
from board.time.scales import GPS_LEAD, TimeMark
from drivers.gnss.bringup import Bringup
from drivers.gnss.bus import BusLine
from drivers.gnss.conversation import Conversation
from drivers.gnss.options import GnssOptions
from drivers.gnss.port import ReceiverLine, SerialLine
from drivers.gnss.receiver import SILENT_S, ReceiverHost
from drivers.gnss.state import ReceiverState
from drivers.reason import Reason
from drivers.wire.garbage import Garbage
from drivers.wire.gnss.fix import fix_of
from drivers.wire.gnss.stream import GnssStream
from drivers.wire.gnss.time import Pulses, counted
from drivers.wire.ublox import ubx
from drivers.wire.ublox.health import MonVer
from drivers.wire.ublox.messages import CfgRst, NavPvt, decode, encode
from drivers.wire.ublox.time import TimTp

log = logging.getLogger("captain.gnss")

# CFG-RST message by the kind of reset that an operator names. All kinds but `full` keep the configuration.
RESETS = {"hot": CfgRst(0, 2), "warm": CfgRst(1, 2), "cold": CfgRst(0xFFFF, 2), "full": CfgRst(0, 1)}

IN_VAIN = 3  # successful bring-ups in a row without an epoch afterwards; then the receiver has failed

FRESH_S = 2.0  # a pulse is trusted only if the last epoch is at most this old

UNKNOWN_NS = 0xFFFF_FFFF  # time accuracy in NAV-PVT of an unknown time


class _Reception:
    """State of reception since the last bring-up.

    stream       splits received octets into frames.
    pulses       finds the times of announced pulses.
    last_second  GPS time of the pulse announced last, in seconds; None before the first.
    """

    def __init__(self, rate_hz: int) -> None:
        self.stream = GnssStream()
        self.pulses = Pulses(1 / rate_hz)
        self.last_second: int | None = None


class UbxReceiver:
    """A u-blox receiver: Bringup configures it, and the ReceiverHost supervises it."""

    def __init__(self, options: GnssOptions, machine: Machine, above: ReceiverHost) -> None:
        host = above.host
        self._options = options
        self._above = above
        self._loop = host.loop
        self._port = self._line(machine)
        self._talk = Conversation(host.loop, self._port.write)
        self._bringup: Bringup | None = None
        self._reception = _Reception(options.rate_hz)
        self._state = ReceiverState(Journal(log, host.name, host.loop.clock, REPEATS))
        self._version: MonVer | None = None
        self._refused: list[str] = []
        self._bringups = self._in_vain = self._garbage = 0
        self._epoch_at = float("-inf")  # time of the last NAV-PVT

    def start(self) -> None:
        self._above.host.starting(f"identifying the receiver at {self._options.where}")
        self._bring_up()

    def stop(self) -> None:
        if self._bringup is not None:
            self._bringup.close()
            self._bringup = None
        self._talk.close()
        self._port.close()

    def silent(self, seconds: float) -> None:
        if self._bringup is not None or not self._port.is_open:
            return
        if self._in_vain == IN_VAIN:
            self._above.failed(self._without_epochs(self._port.path))
            return
        self._above.host.link(False, f"{self._port.path}: no epoch for {SILENT_S:.0f} s; configuring it again")
        try:
            self._bring_up()
        except InterfaceError as error:
            self._above.failed(error)

    def correct(self, frame: bytes) -> None:
        if self._version is not None and self._port.is_open:
            self._port.write(frame)

    def reset(self, kind: str) -> None:
        """Reset the receiver by UBX-CFG-RST.

        Raises RequestError if the kind is not in RESETS, or if no receiver has answered yet.
        """
        if kind not in RESETS:
            raise RequestError(f"unknown reset of a receiver: {kind!r}", f"one of {', '.join(RESETS)}")
        if not self._port.is_open or self._version is None:
            raise RequestError("the receiver is not connected", "`captain gnss status` shows why")
        self._port.write(encode(RESETS[kind]))

    def details(self) -> dict[str, object]:
        version = self._version
        found: dict[str, object] = {"port": self._port.path if self._port.is_open else ""}
        if version is not None:
            found |= {"module": version.module, "firmware": version.firmware, "protocol": version.protocol}
        found |= self._state.details()
        if self._options.corrections:
            dropped = self._port.dropped if self._port.is_open else 0
            found["corrections"] = {**self._state.corrections(), "dropped": dropped}
        return found | {"refused": self._refused, "bringups": self._bringups, "garbage_octets": self._garbage}

    def _line(self, machine: Machine) -> ReceiverLine:
        loop, options = self._above.host.loop, self._options
        if options.i2c:
            return BusLine(loop, options, self._received, self._above.failed)
        return SerialLine(loop, options, machine, self._received, self._above.failed)

    def _bring_up(self) -> None:
        self._reception = _Reception(self._options.rate_hz)
        self._bringups += 1
        self._bringup = Bringup(self._loop, self._talk, self._port, self._options, self._ready, self._above.failed)
        self._bringup.start()

    def _ready(self, version: MonVer, refused: list[str]) -> None:
        if refused and refused != self._refused:
            name, firmware = self._above.host.name, version.firmware
            log.warning("%s: firmware %s does not know %s", name, firmware, ", ".join(refused))
        self._refused, self._bringup, self._version = refused, None, version
        self._in_vain += 1
        self._above.configured(f"{version.module or 'u-blox receiver'} {version.firmware} at {self._port.path}")

    def _without_epochs(self, path: str) -> InterfaceError:
        text = f"{path}: the receiver was configured {IN_VAIN} times and still sends no epochs"
        if self._options.i2c:
            return InterfaceError(text)
        own = self._options.own_port
        return InterfaceError(text, f"set receiver_port to the receiver's port that is connected; it is {own} now")

    def _received(self, octets: bytes) -> None:
        now = self._loop.clock()
        stream = self._reception.stream
        for event in [*stream.expire(now), *stream.receive(octets, now)]:
            if not self._port.is_open:  # an earlier event of this batch led to the stop of the interface
                return
            match event:
                case ubx.UbxFrame():
                    self._take(event, now)
                case Garbage():
                    self._garbage += event.octets
                    self._above.host.drop(event.reason, event.sample)

    def _take(self, frame: ubx.UbxFrame, now: float) -> None:
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
        if self._bringup is not None or not self._port.is_open:
            return
        if isinstance(message, NavPvt):
            self._in_vain = 0
            self._above.epoch(fix_of(message, now))
        elif isinstance(message, TimTp):
            self._mark(message, now)

    def _mark(self, message: TimTp, now: float) -> None:
        """Report the time mark of a pulse once, although the receiver announces each pulse in every epoch."""
        pvt, leap = self._state.pvt, self._state.leap
        pulse = self._reception.pulses.pulse(message, leap, now, None if pvt is None else counted(pvt))
        if pulse.gps == self._reception.last_second and pulse.gps is not None:
            return
        self._reception.last_second = pulse.gps
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
