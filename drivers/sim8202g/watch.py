"""Watch of a modem that is up: registration, bearer, signal, temperature, and stalled packets."""

from collections.abc import Callable

from board.runtime.errors import InterfaceError, ProtocolError
from drivers.sim8202g.bearer import Bearer
from drivers.sim8202g.known import Known
from drivers.sim8202g.questions import Questions
from drivers.sim8202g.script import LostError, Pause, Script, StepError, run
from drivers.sim8202g.system import Counters, System

SLOWLY = 6  # checks of network and bearer per check of temperature and operator

# A change of the cell can take 2 s. If the registration is still missing at a second check, the network is lost.
SECOND_LOOK_S = 5.0

FAILED_MOST = 3  # failed checks in a row that are a fault; a busy modem may fail one

# Packets sent while none was received. A station that only sends causes this as well. Therefore it counts as a stall
# only if the gateway, which answered an echo when the link came up, does not answer any more.
STALL_S = 120.0
STALL_PACKETS = 10
ECHO = ("ping", "-c", "2", "-W", "5", "-I")  # options that ping of iputils and of busybox share

# Limits of the module's own warning. It switches itself off at -40 and +85 (SIM8300G-M2 hardware design V1.01).
COLDEST_C, HOTTEST_C = -30, 70


class Stall:
    """Detector of a stall: packets are sent, but none is received."""

    def __init__(self) -> None:
        self._last: Counters | None = None  # counters when the last packet was received
        self._since: float | None = None  # time of the first packet sent after that

    def is_stalled(self, now: float, counters: Counters | None) -> bool:
        last = self._last
        if counters is None or last is None or counters.received != last.received or counters.sent <= last.sent:
            self._last, self._since = counters, None
            return False
        if self._since is None:
            self._since = now
        return now - self._since >= STALL_S and counters.sent - last.sent >= STALL_PACKETS


class Watch:
    """Script of a modem that is up; it ends with the error that it finds."""

    def __init__(
        self,
        questions: Questions,
        known: Known,
        bearer: Bearer,
        system: System,
        clock: Callable[[], float],
        poll_s: float,
    ) -> None:
        self._questions = questions
        self._known = known
        self._bearer = bearer
        self._system = system
        self._clock = clock
        self._poll_s = poll_s
        self._stall = Stall()
        self._witness: str | None = None  # gateway that answers echoes; empty if none does; None: not tried yet

    def run(self, looked: Callable[[], None]) -> Script[None]:
        """Check the modem every poll_s; call looked() after each successful check.

        Raises LostError if the network or the bearer is lost, StepError for any other fault.
        """
        looks = failed = 0
        self._stall, self._witness = Stall(), None
        while True:
            try:
                yield from self._look(looks % SLOWLY == 0)
            except LostError:
                raise
            except (StepError, ProtocolError):
                failed += 1
                if failed == FAILED_MOST:
                    raise
            else:
                failed = 0
                looked()
            yield from self._look_at_packets()
            looks += 1
            yield Pause(self._poll_s, wakes=True)

    def _look(self, is_slow: bool) -> Script[None]:
        if not (yield from self._questions.ask_registration()):
            yield Pause(SECOND_LOOK_S)
            if not (yield from self._questions.ask_registration()) and self._known.registrations:
                raise LostError(f"network lost: {self._known.registration_text}")
        if not self._known.registrations:
            raise StepError("the modem reports no registration state for any network domain")
        self._known.addresses = yield from self._bearer.look()
        yield from self._questions.look_at_cell()
        if is_slow:
            yield from self._questions.look_at_module()

    def _look_at_packets(self) -> Script[None]:
        """Compare packet counters. Raises StepError if packets only leave, and the gateway does not answer."""
        device = self._bearer.device
        if self._witness is None:
            route = next(iter(self._system.default_routes(device)), None)
            self._witness = route.gateway if route and (yield from self._echoes(route.gateway)) else ""
        if self._stall.is_stalled(self._clock(), self._system.counters(device)) and self._witness:
            if not (yield from self._echoes(self._witness)):
                raise StepError(f"{device}: packets go out, and none has come in for {STALL_S:.0f} s")
            self._stall = Stall()

    def _echoes(self, address: str) -> Script[bool]:
        """Ping an address through the bearer; return True if it answers. Without the program ping: False."""
        try:
            yield from run(*ECHO, self._bearer.device, address)
        except InterfaceError:
            return False
        return True
