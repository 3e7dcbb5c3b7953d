"""What makes a recorder keep what was before: a DENM, a burst of losses, the loss of GNSS time."""

from collections import deque
from collections.abc import Mapping

from drivers.reason import Reason
from firmware.recorder.told import Told

DENM, LOSS, GNSS = "denm", "loss", "gnss"
ALL = (DENM, LOSS, GNSS)
OPERATOR = "operator"

# A DENM is repeated for as long as its event lasts: one of a station that was heard within this time is no other event.
SAME_EVENT_S = 60.0
EVENTS = 256  # stations whose DENMs are remembered
# So many within this time are a burst: a queue that overflows loses more, one frame that is late is none.
LOSSES, LOSSES_S = 10, 1.0
LOST = frozenset(
    {
        Reason.QUEUE_FULL,
        Reason.EXPIRED,
        Reason.LINK_DOWN,
        Reason.SEND_FAILED,
        Reason.KERNEL_QUEUE,
        Reason.RECEIVE_QUEUE,
        Reason.CHECKSUM,
    }
)


class Triggers:
    """wanted: names of ALL that count. Times are those of a monotonic clock, in seconds."""

    def __init__(self, wanted: frozenset[str]) -> None:
        self._wanted = wanted
        self._events: dict[object, float] = {}
        self._losses: deque[tuple[float, int]] = deque()
        self._sum = 0
        self._is_burst = False
        self._was_locked = False

    def frame(self, told: Told, lost: int, now: float) -> str:
        """The trigger that a frame is, or nothing. lost: frames that are missing before it."""
        if DENM in self._wanted and told.type == "denm" and not told.is_dropped and self._is_new(told, now):
            return DENM
        lost += told.said.get("reason") in LOST
        return LOSS if LOSS in self._wanted and lost and self._bursts(lost, now) else ""

    def time(self, status: Mapping[str, object]) -> str:
        """The trigger that a time object of the station is, or nothing: time was by pulses and is not any more."""
        was_locked, self._was_locked = self._was_locked, status.get("state") == "locked"
        return GNSS if GNSS in self._wanted and was_locked and not self._was_locked else ""

    def _is_new(self, told: Told, now: float) -> bool:
        who = told.is_out, told.said.get("station_id")  # others may use this station's number
        before = self._events.pop(who, None)
        if len(self._events) >= EVENTS:
            self._events.pop(next(iter(self._events)))
        self._events[who] = now
        return before is None or now - before > SAME_EVENT_S

    def _bursts(self, lost: int, now: float) -> bool:
        """Whether a burst begins with it."""
        self._losses.append((now, lost))
        self._sum += lost
        while self._losses[0][0] < now - LOSSES_S:
            self._sum -= self._losses.popleft()[1]
        was_burst, self._is_burst = self._is_burst, self._sum >= LOSSES
        return self._is_burst and not was_burst
