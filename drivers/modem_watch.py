"""A modem that is up, looked after: network, bearer, signal, temperature, and packets that only go out."""

from collections.abc import Callable

from board.errors import ProtocolError
from drivers.modem_bearer import Bearer
from drivers.modem_known import Known
from drivers.modem_questions import Questions
from drivers.modem_script import LostError, Pause, Script, StepError
from drivers.modem_system import Counters, System

SLOWLY = 6  # looks at network and bearer for each at temperature and operator

# A cell that is changed can take 2 s; what is not back then is lost.
SECOND_LOOK_S = 5.0

FAILED_MOST = 3  # looks in a row: a modem that is busy may not answer one

# Packets that left without any that came: a ping in each poll suffices to notice, keep-alives of one connection do.
STALL_S = 120.0
STALL_PACKETS = 10

# Of the module's own warning, and of its switching itself off at -40 and +85 (SIM8300G-M2 hardware design V1.01).
COLDEST_C, HOTTEST_C = -30, 70


class Stall:
    """Whether packets come while packets go."""

    def __init__(self) -> None:
        self._at: float | None = None
        self._last = Counters(0, 0)

    def is_stalled(self, now: float, counters: Counters | None) -> bool:
        if counters is None:
            return False
        if self._at is None or counters.received != self._last.received or counters.sent < self._last.sent:
            self._at, self._last = now, counters
        return now - self._at >= STALL_S and counters.sent - self._last.sent >= STALL_PACKETS


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

    def run(self, looked: Callable[[], None]) -> Script[None]:
        """Look again and again; looked is called after each look. Raises StepError: what has happened."""
        stall, looks, failed = Stall(), 0, 0
        while True:
            try:
                yield from self._look(looks % SLOWLY == 0)
                failed = 0
            except LostError:
                raise
            except (StepError, ProtocolError):
                failed += 1
                if failed == FAILED_MOST:
                    raise
            if stall.is_stalled(self._clock(), self._system.counters(self._bearer.device)):
                raise StepError(f"{self._bearer.device}: packets go out, and none has come for {STALL_S:.0f} s")
            looked()
            looks += 1
            yield Pause(self._poll_s, wakes=True)

    def _look(self, is_slow: bool) -> Script[None]:
        if not (yield from self._questions.ask_registration()):
            yield Pause(SECOND_LOOK_S)
            if not (yield from self._questions.ask_registration()):
                raise LostError(f"network lost: {self._known.registration_text}")
        self._known.addresses = yield from self._bearer.look()
        yield from self._questions.look_at_cell()
        if is_slow:
            yield from self._questions.look_at_module()
