"""A simulated ZED-F9P on a pty: it boots, is configured, drives along a track, and has trouble when it is told to."""

import itertools
from collections import deque
from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from typing import Literal

from board.loop import Loop, Timer
from board.time import Carrier, FixKind
from drivers.sim import receiver_messages as says
from drivers.sim.receiver_line import ReceiverLine
from drivers.sim.receiver_memory import Memory
from drivers.sim.receiver_messages import Moment, Sky
from drivers.sim.track import Track
from drivers.wire import rtcm, ubx
from drivers.wire.gnss_stream import GnssStream
from drivers.wire.gnss_time import Leap
from drivers.wire.ubx import Kind
from drivers.wire.ubx_health import MonVer
from drivers.wire.ubx_messages import Ack, CfgRst, Message, Nak, RxmRtcm, decode, encode
from drivers.wire.ubx_values import ValGet, ValSet

KEPT = 1000  # frames that it heard, for tests to look at
HOT_S = 1.5  # from a reset that forgets nothing to a fix
LATENCY_S = 0.03  # from an epoch until it is said
# Since corrections came first, without a pause of RTK_OLD_S between.
RTK_FLOAT_S, RTK_FIXED_S, RTK_OLD_S = 2.0, 8.0, 30.0

VERSION = MonVer(
    "EXT CORE 1.00 (3fda8e)",
    "00190000",
    ("ROM BASE 0x118B2060", "FWVER=HPG 1.32", "PROTVER=27.31", "MOD=ZED-F9P", "GPS;GLO;GAL;BDS", "SBAS;QZSS"),
)


@dataclass(frozen=True)
class Habits:
    """What a receiver is like.

    gps_s         GPS time when it is made.
    gadget        path of a USB gadget's tty (/dev/ttyGS0) that it speaks at, in place of a pty.
    port          that somebody is at: a USB device comes and goes; a UART, and what stands for an I2C bus, is
                  always there.
    speaks_ubx    False: an NMEA receiver.
    boot_s        from power to the first word.
    fix_s, leap_s from power, or a cold reset, to a fix, and to leap seconds from satellites.
    leap          true leap seconds; default_leap is what the firmware takes before it has them.
    repeats       how TIM-TP numbers a leap second: as the second before it, or as that behind.
    unknown       names of keys that its firmware does not know.
    """

    gps_s: int = says.gps_of(2026, 6, 1, 8, 0, 0)
    port: Literal["usb", "uart1", "i2c"] = "usb"
    gadget: str = ""
    speaks_ubx: bool = True
    boot_s: float = 0.8
    fix_s: float = 2.0
    leap_s: float = 2.0
    leap: Leap = field(default_factory=lambda: Leap(18))
    default_leap: int = 18
    repeats: bool = False
    unknown: Collection[str] = ()
    version: MonVer = VERSION


class Receiver:
    """The module: power() supplies it, and appeared() is told the path of its port, vanished() that it is gone.

    sky          around it; replaced by a test.
    is_deaf      it takes nothing that is said to it. is_mute: it says nothing: it hangs.
    acknowledges False: it obeys and does not say so.
    heard        RTCM frames that came in last. requests: UBX frames.
    """

    def __init__(
        self,
        loop: Loop,
        habits: Habits | None = None,
        track: Track | None = None,
        appeared: Callable[[str], None] = lambda path: None,
        vanished: Callable[[], None] = lambda: None,
    ) -> None:
        self.habits = habits or Habits()
        self.sky = Sky()
        self.is_deaf = self.is_mute = False
        self.acknowledges = True
        self.heard: deque[rtcm.Frame] = deque(maxlen=KEPT)
        self.requests: deque[ubx.Frame] = deque(maxlen=KEPT)
        self.memory = Memory(self.habits.unknown)
        self.boots = 0
        self._loop = loop
        self._track = track or Track()
        self._appeared, self._vanished = appeared, vanished
        self._made = loop.clock()
        self._line = ReceiverLine(loop, self._hear, self._baud, self.habits.gadget)
        self._timer: Timer | None = None
        self._is_on = self._is_running = False
        if self.habits.port != "usb":
            self._open()

    # The outside

    @property
    def path(self) -> str:
        """Of its port; empty while there is none."""
        return self._line.path

    def power(self, on: bool) -> None:
        """Supply it, or not; what it was told for RAM alone is forgotten."""
        if on is self._is_on:
            return
        if self._timer is not None:
            self._timer.cancel()
        self._is_on, self._is_running = on, False
        if on:
            self._timer = self._loop.after(self.habits.boot_s, self._boot)
        elif self.habits.port == "usb":
            self._close()

    def unplug(self) -> None:
        """Its port disappears, and its power too; idempotent."""
        self.power(False)
        self._close()

    def say(self, octets: bytes) -> None:
        """Say any octets: garbage, or a message that a test has made."""
        self._line.say(octets)

    def gps_ms(self) -> int:
        """GPS time of now."""
        return self.habits.gps_s * 1000 + round((self._loop.clock() - self._made) * 1000)

    # Life

    def _boot(self) -> None:
        self.boots += 1
        self._is_running = True
        self.memory.boot()
        self._booted = self._searching = self._loop.clock()
        self._is_cold = True
        self._corrected: tuple[float, float] | None = None  # since when, and when last
        self._count = itertools.count()
        self._stream = GnssStream()
        if not self._line.is_open:
            self._open()
        self._wait_for_epoch()

    def _restart(self, reset: CfgRst) -> None:
        if reset.mode == 2:
            self._searching, self._is_cold = self._loop.clock(), reset.forget == 0xFFFF
            return
        self.power(False)
        self.power(True)

    def _open(self) -> None:
        self._line.open()
        self._appeared(self._line.path)

    def _close(self) -> None:
        was_open = self._line.is_open
        self._line.close()
        if was_open:
            self._vanished()

    def _baud(self) -> int | None:
        return self.memory.baud if self.habits.port == "uart1" and self.habits.speaks_ubx else None

    # What it says by itself

    def _wait_for_epoch(self) -> None:
        period = self.memory.period_ms
        self._epoch_ms = (self.gps_ms() // period + 1) * period
        delay = (self._epoch_ms - self.gps_ms()) / 1000 + LATENCY_S
        self._timer = self._loop.after(delay, self._epoch)

    def _epoch(self) -> None:
        count = next(self._count)
        moment = self._moment(self._epoch_ms)
        self._wait_for_epoch()
        if self.is_mute:
            return
        octets = b"".join(
            encode(made(moment)) for name, made in _MESSAGES.items() if self._is_due(f"UBX_{name}", count)
        )
        if self._is_due("UBX_TIM_TP", count):
            octets += encode(self._pulse(moment))
        if self.memory.speaks("nmea", self._port):
            for formatter, sentence in says.sentences(moment).items():
                if self._is_due(f"NMEA_ID_{formatter}", count):
                    octets += sentence
        if octets:
            self.say(octets)

    def _pulse(self, moment: Moment) -> Message:
        return says.tim_tp(moment, self.memory.value("CFG-TP-TIMEGRID_TP1") == 0, self.habits.repeats)

    def _is_due(self, message: str, count: int) -> bool:
        rate = self.memory.value(f"CFG-MSGOUT-{message}_{self._port}")
        is_ubx = message.startswith("UBX")
        return bool(rate) and count % rate == 0 and (not is_ubx or self.habits.speaks_ubx)

    @property
    def _port(self) -> str:
        return self.habits.port.upper()

    def _moment(self, gps_ms: int) -> Moment:
        now = self._loop.clock()
        searched = now - self._searching
        has_fix = self.sky.satellites > 3 and searched >= (self.habits.fix_s if self._is_cold else HOT_S)
        is_resolved = searched >= self.habits.leap_s or not self._is_cold
        carrier, age = self._rtk(now) if has_fix else (Carrier.NONE, 0)
        return Moment(
            gps_ms,
            self.habits.leap,
            is_resolved,
            self.habits.default_leap,
            FixKind.FULL if has_fix else FixKind.NONE,
            carrier,
            age,
            self._track.at(gps_ms / 1000 - self.habits.gps_s),
            self.sky,
            round((now - self._booted) * 1000),
            round(self.habits.fix_s * 1000),
        )

    def _rtk(self, now: float) -> tuple[Carrier, int]:
        """How far the ambiguities are resolved, and the age of corrections as a row of CORRECTION_AGE_S."""
        if self._corrected is None or now - self._corrected[1] > RTK_OLD_S:
            self._corrected = None
            return Carrier.NONE, 0
        since, last = self._corrected
        age = 1 + sum(now - last > most for most in (1, 2, 5, 10, 15, 20))
        if now - since < RTK_FLOAT_S:
            return Carrier.NONE, age
        return (Carrier.FIXED if now - since >= RTK_FIXED_S else Carrier.FLOAT), age

    # What it hears

    def _hear(self, octets: bytes) -> None:
        if not self._is_running or self.is_deaf:
            return
        now = self._loop.clock()
        for event in [*self._stream.expire(now), *self._stream.receive(octets, now)]:
            if not self._is_running:  # it was reset
                return
            if isinstance(event, ubx.Frame) and self.habits.speaks_ubx and self.memory.hears("ubx", self._port):
                self.requests.append(event)
                self._obey(event)
            elif isinstance(event, rtcm.Frame) and self.memory.hears("rtcm3x", self._port):
                self._correct(event, now)

    def _correct(self, frame: rtcm.Frame, now: float) -> None:
        self.heard.append(frame)
        since = self._corrected[0] if self._corrected else now
        self._corrected = (since, now)
        if self._is_due("UBX_RXM_RTCM", 0):
            self._answer(RxmRtcm(2, 2 << 1, 0, 0, frame.number or 0))

    def _obey(self, frame: ubx.Frame) -> None:
        if not frame.payload:
            self._poll(frame.kind)
            return
        message = decode(frame)
        match message:
            case ValSet():
                baud = self.memory.baud
                is_taken = self.memory.set(message)
                # The acknowledgement of a change of the rate goes out at the new one: it is lost.
                if self.memory.baud == baud:
                    self._acknowledge(Kind.CFG_VALSET, is_taken)
            case ValGet():
                answer = self.memory.get(message)
                if answer is not None:
                    self._answer(answer)
                self._acknowledge(Kind.CFG_VALGET, answer is not None)
            case CfgRst():
                self._restart(message)

    def _poll(self, kind: int) -> None:
        if kind == Kind.MON_VER:
            self._answer(self.habits.version)
            return
        name = ubx.name(kind).replace("-", "_")
        if name in _MESSAGES:
            self._answer(_MESSAGES[name](self._moment(self.gps_ms())))

    def _acknowledge(self, kind: Kind, is_taken: bool) -> None:
        if self.acknowledges:
            about = divmod(kind, 256)
            self._answer(Ack(*about) if is_taken else Nak(*about))

    def _answer(self, message: Message) -> None:
        if not self.is_mute:
            self.say(encode(message))


_MESSAGES: dict[str, Callable[[Moment], Message]] = {
    "NAV_PVT": says.nav_pvt,
    "NAV_STATUS": says.nav_status,
    "NAV_TIMELS": says.nav_timels,
    "MON_RF": says.mon_rf,
    "SEC_SIG": says.sec_sig,
}
