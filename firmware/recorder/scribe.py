"""Writer of frames to pcapng: sections, interfaces, comments, counts of lost frames."""

from collections import Counter
from collections.abc import Mapping

from firmware import VERSION
from firmware.recorder.reported_frame import MOST, ReportedFrame, comment_of, kept_of
from firmware.recordings.pcapng import Direction, Pcapng, Stream

# Keys of the station's status that are written to the header of a section.
KNOWN = ("station", "version", "profile", "configuration", "boot", "pid")


class Scribe:
    """Writes reported frames to a stream, and can continue in another stream.

    written  written frames by interface.
    gone     lost frames by interface.
    missing  part of gone that was lost between station and recorder.
    killed   part of gone that was lost with an earlier process.
    reached  by interface, the station's `total` of the last frame counted as written or lost.
    """

    def __init__(self) -> None:
        self.written: Counter[str] = Counter()
        self.gone: Counter[str] = Counter()
        self.missing = 0
        self.killed = 0
        self.reached: dict[str, int] = {}
        self._about: dict[str, object] = {}
        self._descriptions: dict[str, str] = {}
        self._pcapng: Pcapng | None = None
        self._stream: Stream | None = None
        self._totals: dict[str, int] | None = None  # totals of the last status by interface, until settle() counts them
        # True after settle(): frames of a new interface are then counted from its first one on
        self._is_settled = False
        self._successor: set[str] | None = None  # interfaces with a frame since restore(); None without restore()
        self._last: dict[str, int] = {}  # last sequence number by interface, for a station that reports no total
        self._lost: Counter[str] = Counter()  # lost frames by interface since its last written frame
        self._written: Counter[str] = Counter()  # written frames of this section by interface
        self._gone: Counter[str] = Counter()
        self._when_ns = 0

    @property
    def frames(self) -> int:
        return self.written.total()

    @property
    def lost(self) -> int:
        return self.gone.total()

    @property
    def size(self) -> int:
        """Octets of the current section."""
        return self._pcapng.size if self._pcapng else 0

    def take_status(self, status: Mapping[str, object]) -> None:
        """Take the status of the station; a restart of the station begins another section."""
        about = {key: status[key] for key in KNOWN if key in status}
        interfaces = status.get("interfaces")
        if isinstance(interfaces, dict):
            self._descriptions = {name: _description(one) for name, one in interfaces.items()}
        if about != self._about:
            self._about = about
            self._last.clear()
            if self._successor is None or self._is_settled:
                self.reached.clear()
            self._is_settled = False
            if self._stream is not None:
                self.begin(self._stream)
        report = status.get("report")
        totals = report.get("frames") if isinstance(report, dict) else None
        if isinstance(totals, dict):
            self._totals = {name: total for name, total in totals.items() if _is_count(total)}

    def settle(self) -> None:
        """Count as lost the frames that the status reports but that have not arrived.

        Frames that arrived before the status are already counted.
        """
        totals, self._totals = self._totals, None
        if totals is None:
            return
        for interface, total in totals.items():
            if self._successor is None and interface not in self.reached:
                self.reached[interface] = total  # these were reported before the recording began
            self._reach(interface, total + 1)
            self.reached[interface] = max(total, self.reached.get(interface, 0))
        self._is_settled = True

    def restore(self, written: Mapping[str, int], gone: Mapping[str, int], reached: Mapping[str, int]) -> None:
        """Continue the counts of a killed process.

        Frames that it did not write, and those reported since, count as lost.
        """
        self.written.update(written)
        self.gone.update(gone)
        self.reached.update(reached)
        self._successor = set()

    def begin(self, stream: Stream) -> None:
        """Begin a section in a stream."""
        self.end()
        words = ", ".join(f"{key} {value}" for key, value in self._about.items())
        self._stream = stream
        self._pcapng = Pcapng(stream, f"captain {VERSION}", f"recorded by captain {VERSION}; {words}", self._about)

    def end(self) -> None:
        """Write the statistics of the section: written and lost frames of each interface; then stop writing."""
        if self._pcapng is not None:
            for interface in self._written | self._lost:
                lost = self._gone[interface] + self._lost[interface]
                self._pcapng.statistics(interface, self._when_ns, self._written[interface], lost)
        self.abandon()

    def abandon(self) -> None:
        """Stop writing to the stream, without statistics."""
        self._pcapng = self._stream = None
        self._written.clear()
        self._gone.clear()

    def add(self, told: ReportedFrame) -> None:
        """Write a frame. Without a stream it counts as lost; the comment of the next written frame gives the number."""
        self.pass_over(told)
        if self._pcapng is None:
            self._lost[told.interface] += 1
            self.gone[told.interface] += 1
            return
        lost = self._lost.pop(told.interface, 0)
        comment = comment_of(told)
        if lost:
            comment = f"{lost} frames before this one are missing; {comment}"
        self._pcapng.interface(told.interface, self._descriptions.get(told.interface, ""))
        direction = Direction.OUT if told.is_out else Direction.IN
        said = kept_of(told.said)
        self._pcapng.add(told.interface, told.when_ns, told.frame, direction, comment, said, lost)
        self.written[told.interface] += 1
        self._written[told.interface] += 1
        self._gone[told.interface] += lost
        self._when_ns = told.when_ns

    def pass_over(self, told: ReportedFrame) -> None:
        """Count the losses before a frame that is not itself written.

        Losses are gaps in the sequence, and frames that the station did not report.
        """
        sequence, missed, total = (told.said.get(key) for key in ("sequence", "missed", "total"))
        if not isinstance(sequence, int) or not isinstance(missed, int):
            return
        interface = told.interface
        if isinstance(total, int):
            if interface not in self.reached and not self._is_settled and self._successor is None:
                self.reached[interface] = total - 1 - missed
            self._reach(interface, total)
            self.reached[interface] = max(total, self.reached.get(interface, 0))
            return
        last = self._last.get(interface)
        gap = max(0, sequence - last - 1) if last is not None else 0
        self._last[interface] = sequence
        self._lack(interface, gap + missed)

    def _reach(self, interface: str, total: int) -> None:
        """Count all frames between the last known one and `total` as lost.

        At the first frame of an interface since restore(), they count as lost with the earlier process.
        """
        gap = total - self.reached.get(interface, 0) - 1
        if self._successor is not None and interface not in self._successor:
            self._successor.add(interface)
            self.count_lost(interface, max(0, gap))
        else:
            self._lack(interface, max(0, gap))

    def count_lost(self, interface: str, count: int) -> None:
        """Count frames as lost with the earlier process."""
        self.killed += count
        self._lost[interface] += count
        self.gone[interface] += count

    def _lack(self, interface: str, count: int) -> None:
        self.missing += count
        self._lost[interface] += count
        self.gone[interface] += count

    def unwrite(self, count: Mapping[str, int]) -> None:
        """Count frames as lost, by interface, that were given to a stream but not written."""
        for interface, number in count.items():
            self._lost[interface] += number
            self.written[interface] -= number
            self.gone[interface] += number


def _is_count(value: object) -> bool:
    return type(value) is int and 0 <= value <= MOST


def _description(status: object) -> str:
    if not isinstance(status, dict):
        return ""
    technology, driver = status.get("technology", ""), status.get("driver", "")
    return f"{technology} by {driver}" if driver else str(technology)
