"""A modem that is up, looked after: network, bearer, signal, temperature, and packets that only go out."""

from collections.abc import Callable

from board.errors import InterfaceError, ProtocolError
from drivers.modem_bearer import Bearer
from drivers.modem_known import Known
from drivers.modem_questions import Questions
from drivers.modem_script import LostError, Pause, Script, StepError, run
from drivers.modem_system import Counters, System

SLOWLY = 6  # looks at network and bearer for each at temperature and operator

# A cell that is changed can take 2 s; what is not back then is lost.
SECOND_LOOK_S = 5.0

FAILED_MOST = 3  # looks in a row: a modem that is busy may not answer one

# Packets that left without any that came. A station that only sends does that as well, so that it is no stall before
# the gateway, which answered an echo when the link came up, does not any more.
STALL_S = 120.0
STALL_PACKETS = 10
ECHO = ("ping", "-c", "2", "-W", "5", "-I")  # of iputils and of busybox

# Of the module's own warning, and of its switching itself off at -40 and +85 (SIM8300G-M2 hardware design V1.01).
COLDEST_C, HOTTEST_C = -30, 70


class Stall:
    """Whether packets come while packets go: since the first that was sent after the last that came."""

    def __init__(self) -> None:
        self._last: Counters | None = None  # when one came
        self._since: float | None = None  # when the first was sent that nothing has answered

    def is_stalled(self, now: float, counters: Counters | None) -> bool:
        last = self._last
        if counters is None or last is None or counters.received != last.received or counters.sent <= last.sent:
            self._last, self._since = counters, None
            return False
        if self._since is None:
            self._since = now
        return now - self._since >= STALL_S and counters.sent - last.sent >= STALL_PACKETS


class Watch:
    """The script of an interface that is up: it ends with the error that it finds."""

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
        self._witness: str | None = None  # a gateway that answers echoes; empty: there is none; None: not known yet

    def run(self, looked: Callable[[], None]) -> Script[None]:
        """Look again and again; looked is called after each look. Raises StepError: what has happened."""
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
            raise StepError("no domain says whether it is registered")
        self._known.addresses = yield from self._bearer.look()
        yield from self._questions.look_at_cell()
        if is_slow:
            yield from self._questions.look_at_module()

    def _look_at_packets(self) -> Script[None]:
        """Raises StepError where they only go out, and the gateway has fallen silent."""
        device = self._bearer.device
        if self._witness is None:
            route = next(iter(self._system.default_routes(device)), None)
            self._witness = route.gateway if route and (yield from self._echoes(route.gateway)) else ""
        if self._stall.is_stalled(self._clock(), self._system.counters(device)) and self._witness:
            if not (yield from self._echoes(self._witness)):
                raise StepError(f"{device}: packets go out, and none has come for {STALL_S:.0f} s")
            self._stall = Stall()

    def _echoes(self, address: str) -> Script[bool]:
        """Whether an address answers an echo through the bearer. Without ping none does."""
        try:
            yield from run(*ECHO, self._bearer.device, address)
        except InterfaceError:
            return False
        return True
