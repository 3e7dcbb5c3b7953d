"""Triggers of a recorder: a DENM, a burst of losses, loss of GNSS time."""

from collections import deque
from collections.abc import Mapping

from drivers.reason import Reason
from firmware.recorder.reported_frame import ReportedFrame

DENM, LOSS, GNSS = "denm", "loss", "gnss"
ALL = (DENM, LOSS, GNSS)
OPERATOR = "operator"

# A DENM is repeated while its event lasts. Further DENMs of a station within this time belong to the same event.
SAME_EVENT_S = 60.0
EVENTS = 256  # stations whose last DENM is remembered
# A burst is at least this number of lost frames in this time. An overflowing queue loses more, a late frame fewer.
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
    """Detects the events that trigger a recording.

    wanted  names of the events to detect, from ALL.

    Times are those of a monotonic clock, in seconds.
    """

    def __init__(self, wanted: frozenset[str]) -> None:
        self._wanted = wanted
        self._events: dict[object, float] = {}
        self._losses: deque[tuple[float, int]] = deque()
        self._sum = 0
        self._is_burst = False
        self._was_locked = False

    def frame(self, told: ReportedFrame, lost: int, now: float) -> str:
        """Return the event that a frame triggers, or "".

        lost  number of frames missing before this one.
        now   monotonic time in seconds.
        """
        if DENM in self._wanted and told.type == "denm" and not told.is_dropped and self._is_new(told, now):
            return DENM
        lost += told.said.get("reason") in LOST
        return LOSS if LOSS in self._wanted and lost and self._bursts(lost, now) else ""

    def time(self, status: Mapping[str, object]) -> str:
        """Return GNSS if a time report says that the time is no longer locked to pulses; otherwise ""."""
        was_locked, self._was_locked = self._was_locked, status.get("state") == "locked"
        return GNSS if GNSS in self._wanted and was_locked and not self._was_locked else ""

    def _is_new(self, told: ReportedFrame, now: float) -> bool:
        # The direction is part of the key, because other stations may use this station's stationID.
        who = told.is_out, told.said.get("station_id")
        before = self._events.pop(who, None)
        if len(self._events) >= EVENTS:
            self._events.pop(next(iter(self._events)))
        self._events[who] = now
        return before is None or now - before > SAME_EVENT_S

    def _bursts(self, lost: int, now: float) -> bool:
        """Whether these losses begin a burst."""
        self._losses.append((now, lost))
        self._sum += lost
        while self._losses[0][0] < now - LOSSES_S:
            self._sum -= self._losses.popleft()[1]
        was_burst, self._is_burst = self._is_burst, self._sum >= LOSSES
        return self._is_burst and not was_burst
