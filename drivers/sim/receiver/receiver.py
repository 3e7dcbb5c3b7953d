"""Simulated ZED-F9P on a pty: boots, takes configuration, follows a track, fails on request."""

import itertools
from collections import deque
from collections.abc import Callable

from board.runtime.loop import Loop, Timer
from board.time.scales import FixKind
from drivers.sim.receiver import messages as says
from drivers.sim.receiver.habits import Habits
from drivers.sim.receiver.line import ReceiverLine
from drivers.sim.receiver.memory import Memory
from drivers.sim.receiver.messages import Moment, Sky
from drivers.sim.receiver.navigation import COLD, Navigation
from drivers.sim.track import Track
from drivers.wire import rtcm
from drivers.wire.gnss.stream import GnssStream
from drivers.wire.ublox import ubx
from drivers.wire.ublox.messages import Ack, CfgRst, Message, Nak, RxmRtcm, decode, encode
from drivers.wire.ublox.ubx import Kind
from drivers.wire.ublox.values import ValGet, ValSet

KEPT = 1000  # received frames that are kept for tests
LATENCY_S = 0.03  # seconds from an epoch until its messages are sent


class Receiver:
    """Simulated receiver module. power() switches its supply.

    appeared, vanished  callbacks when its port appears, with the path, and disappears.
    sky           surroundings; a test may replace them.
    is_deaf       True: it ignores everything it receives.
    is_mute       True: it sends nothing, as if it hangs.
    acknowledges  False: it executes commands without acknowledging them.
    heard         last received RTCM frames.
    requests      last received UBX frames.
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
        self.heard: deque[rtcm.RtcmFrame] = deque(maxlen=KEPT)
        self.requests: deque[ubx.UbxFrame] = deque(maxlen=KEPT)
        self.memory = Memory(self.habits.unknown)
        self.boots = 0
        self._loop = loop
        self._track = track or Track()
        self._appeared, self._vanished = appeared, vanished
        self._made = loop.clock() - self.habits.fraction_s
        self._line = ReceiverLine(loop, self._hear, self._baud, self.habits.gadget)
        # Each boot replaces these.
        self._navigation = Navigation(self.habits, self._track, loop.clock())
        self._count = itertools.count()
        self._stream = GnssStream()
        self._epoch_ms = 0
        self._timer: Timer | None = None
        self._is_on = self._is_running = False
        if self.habits.port != "usb":
            self._open()

    # Functions for users

    @property
    def path(self) -> str:
        """Path of its port; empty while closed."""
        return self._line.path

    def power(self, on: bool) -> None:
        """Switch the supply on or off; the configuration in RAM is lost."""
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
        """Remove its port and its power; idempotent."""
        self.power(False)
        self._close()

    def say(self, octets: bytes) -> None:
        """Send any octets: garbage, or a message of a test."""
        self._line.say(octets)

    def gps_ms(self) -> int:
        """Return the current GPS time in ms."""
        return self.habits.gps_s * 1000 + round((self._loop.clock() - self._made) * 1000)

    def gps_ns(self, monotonic: float) -> int:
        """Return the GPS time in ns at a time of the loop's clock, with the resolution of that clock."""
        return self.habits.gps_s * 10**9 + round((monotonic - self._made) * 1e9)

    @property
    def gives_pulses(self) -> bool:
        """True while its pulses follow the satellites; otherwise its configuration disables pulses."""
        if not self._is_running or not self.sky.is_locked:
            return False
        return self._navigation.moment(self.gps_ms(), self.sky, self._loop.clock()).kind is not FixKind.NONE

    # Boot, reset and port

    def _boot(self) -> None:
        self.boots += 1
        self._is_running = True
        self.memory.boot()
        self._navigation = Navigation(self.habits, self._track, self._loop.clock())
        self._count = itertools.count()
        self._stream = GnssStream()
        if not self._line.is_open:
            self._open()
        self._wait_for_epoch()

    def _restart(self, reset: CfgRst) -> None:
        if reset.mode == 2:
            self._navigation.reset(reset.forget == COLD, self._loop.clock())
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

    # Messages that it sends by itself

    def _wait_for_epoch(self) -> None:
        period = self.memory.period_ms
        self._epoch_ms = (self.gps_ms() // period + 1) * period
        delay = (self._epoch_ms - self.gps_ms()) / 1000 + LATENCY_S
        self._timer = self._loop.after(delay, self._epoch)

    def _epoch(self) -> None:
        count = next(self._count)
        moment = self._navigation.moment(self._epoch_ms, self.sky, self._loop.clock())
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
        if message == "UBX_TIM_TP":
            is_said = self.sky.has_marks
        else:
            is_said = self.sky.has_epochs or (is_ubx and message != "UBX_NAV_PVT")
        return is_said and bool(rate) and count % rate == 0 and (not is_ubx or self.habits.speaks_ubx)

    @property
    def _port(self) -> str:
        return self.habits.port.upper()

    # Received messages

    def _hear(self, octets: bytes) -> None:
        if not self._is_running or self.is_deaf:
            return
        now = self._loop.clock()
        for event in [*self._stream.expire(now), *self._stream.receive(octets, now)]:
            if not self._is_running:  # the previous message was a reset
                return
            if isinstance(event, ubx.UbxFrame) and self.habits.speaks_ubx and self.memory.hears("ubx", self._port):
                self.requests.append(event)
                self._obey(event)
            elif isinstance(event, rtcm.RtcmFrame) and self.memory.hears("rtcm3x", self._port):
                self._correct(event, now)

    def _correct(self, frame: rtcm.RtcmFrame, now: float) -> None:
        self.heard.append(frame)
        self._navigation.correct(now)
        if self._is_due("UBX_RXM_RTCM", 0):
            self._answer(RxmRtcm(2, 2 << 1, 0, 0, frame.number or 0))

    def _obey(self, frame: ubx.UbxFrame) -> None:
        if not frame.payload:
            self._poll(frame.kind)
            return
        message = decode(frame)
        match message:
            case ValSet():
                baud = self.memory.baud
                is_taken = self.memory.set(message)
                # After a change of the baud rate, the acknowledgement is sent at the new rate, and is lost.
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
            self._answer(_MESSAGES[name](self._navigation.moment(self.gps_ms(), self.sky, self._loop.clock())))

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
