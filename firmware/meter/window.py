"""Time line: figures of each averaging interval T."""

from collections import OrderedDict
from collections.abc import Iterator

from firmware.meter.delay import one_way
from firmware.meter.fate import Fate, Settled

MOST = 7200  # most intervals kept per direction: two hours at intervals of 1 s


class Window:
    """Figures of one interval.

    A message belongs to the interval in which its sending was reported; a gap to that of its end.
    """

    __slots__ = (
        "arrived",
        "delay_longest_us",
        "delay_us",
        "duplicates",
        "gap_longest_s",
        "lost",
        "measured",
        "reordered",
        "rssi_dbm",
        "rssi_measured",
        "sent",
        "unseen",
    )

    def __init__(self) -> None:
        self.sent = self.arrived = self.lost = self.unseen = self.duplicates = self.reordered = 0
        self.measured = self.rssi_measured = 0
        self.delay_us = self.delay_longest_us = self.gap_longest_s = self.rssi_dbm = 0.0

    def as_json(self) -> dict[str, object]:
        """Return means and counts as an object for JSON; null if nothing was measured."""
        return {
            "sent": self.sent,
            "arrived": self.arrived,
            "lost": self.lost,
            "unseen": self.unseen,
            "duplicates": self.duplicates,
            "reordered": self.reordered,
            "delay_us": round(self.delay_us / self.measured, 1) if self.measured else None,
            "delay_longest_us": round(self.delay_longest_us, 1) if self.measured else None,
            "gap_longest_s": round(self.gap_longest_s, 6) if self.gap_longest_s else None,
            "rssi_dbm": round(self.rssi_dbm / self.rssi_measured, 1) if self.rssi_measured else None,
        }


class Windows:
    """Intervals of one direction.

    length_s   interval T in seconds.
    forgotten  number of the oldest intervals that were removed beyond the limit.
    """

    def __init__(self, length_s: float, most: int = MOST) -> None:
        self.length_s = length_s
        self.forgotten = 0
        self._most = most
        self._windows: OrderedDict[int, Window] = OrderedDict()
        self._last_ns: int | None = None

    def add(self, one: Settled) -> None:
        event = one.sent or one.received
        if event is None or one.fate is Fate.STRANGE:
            return
        window = self._at(event.at_s)
        window.lost += (one.fate is Fate.LOST) - (one.was is Fate.LOST)
        window.unseen += (one.fate is Fate.UNSEEN) - (one.was is Fate.UNSEEN)
        window.duplicates += one.fate is Fate.DUPLICATE
        window.sent += one.sent is not None and one.was in (None, Fate.STRANGE)
        if one.sent is not None and one.received is not None:
            self._arrived(window, one)

    def _arrived(self, window: Window, one: Settled) -> None:
        assert one.received is not None
        received = one.received
        window.arrived += 1
        window.reordered += one.is_reordered
        if received.rssi_dbm is not None:
            window.rssi_dbm += received.rssi_dbm
            window.rssi_measured += 1
        if one.sent is not None and not one.is_repeat and (delay := one_way(one.sent, received)) is not None:
            window.delay_us += delay.ns / 1000
            window.delay_longest_us = max(window.delay_longest_us, delay.ns / 1000)
            window.measured += 1
        if self._last_ns is not None and received.received_ns > self._last_ns:
            ending = self._at(received.at_s)
            ending.gap_longest_s = max(ending.gap_longest_s, (received.received_ns - self._last_ns) / 1e9)
        self._last_ns = received.received_ns

    def _at(self, at_s: float) -> Window:
        index = int(at_s // self.length_s)
        window = self._windows.get(index)
        if window is None:
            window = self._windows[index] = Window()
            if len(self._windows) > self._most:
                del self._windows[min(self._windows)]
                self.forgotten += 1
        return window

    def __iter__(self) -> Iterator[tuple[float, Window]]:
        """Yield start time and figures of each interval in order; intervals without messages are omitted."""
        for index in sorted(self._windows):
            yield index * self.length_s, self._windows[index]
