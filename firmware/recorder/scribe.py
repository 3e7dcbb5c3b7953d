"""Frames into pcapng: sections that say whose they are, interfaces with their names, and what is missing."""

from collections import Counter
from collections.abc import Mapping

from firmware import VERSION
from firmware.codec.pcapng import Direction, Pcapng, Stream
from firmware.recorder.told import MOST, Told, comment_of, kept_of

# What of a status a recording says of its station.
KNOWN = ("station", "version", "profile", "configuration", "boot", "pid")


class Scribe:
    """Writes what is told; a recording may go on in another stream.

    written  frames, by interface. gone: that were not, as far as is known.
    missing  of these, what was lost on the way here. killed: with a process that wrote before this one.
    reached  by interface, the `total` of the last frame that is in either count.
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
        self._totals: dict[str, int] | None = None  # of the last status, until settle()
        self._is_settled = False  # frames of interfaces that no status names count from the first on
        self._successor: set[str] | None = None  # interfaces of which something was heard after restore()
        self._last: dict[str, int] = {}  # sequence by interface, of a station that says no total
        self._lost: Counter[str] = Counter()  # by interface, since its last frame that was written
        self._written: Counter[str] = Counter()  # of this section
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
        """Octets of this section."""
        return self._pcapng.size if self._pcapng else 0

    def know(self, status: Mapping[str, object]) -> None:
        """Who the station is, by its status; another start of it begins another section."""
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
        """Count what the status says was told, once the frames that came before it were added."""
        totals, self._totals = self._totals, None
        if totals is None:
            return
        for interface, total in totals.items():
            if self._successor is None and interface not in self.reached:
                self.reached[interface] = total  # told before this recording began
            self._reach(interface, total + 1)
            self.reached[interface] = max(total, self.reached.get(interface, 0))
        self._is_settled = True

    def restore(self, written: Mapping[str, int], gone: Mapping[str, int], reached: Mapping[str, int]) -> None:
        """Go on where another process was killed; what it did not write is lost, and so is what came meanwhile."""
        self.written.update(written)
        self.gone.update(gone)
        self.reached.update(reached)
        self._successor = set()

    def begin(self, stream: Stream) -> None:
        """Go on in a stream, with a section of its own."""
        self.end()
        words = ", ".join(f"{key} {value}" for key, value in self._about.items())
        self._stream = stream
        self._pcapng = Pcapng(stream, f"captain {VERSION}", f"recorded by captain {VERSION}; {words}", self._about)

    def end(self) -> None:
        """Write down how many frames the section has of each interface, and how many it has not."""
        if self._pcapng is not None:
            for interface in self._written | self._lost:
                lost = self._gone[interface] + self._lost[interface]
                self._pcapng.statistics(interface, self._when_ns, self._written[interface], lost)
        self.abandon()

    def abandon(self) -> None:
        """The stream takes nothing any more."""
        self._pcapng = self._stream = None
        self._written.clear()
        self._gone.clear()

    def add(self, told: Told) -> None:
        """Write a frame; without a stream it is lost, and the next one says so."""
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

    def pass_over(self, told: Told) -> None:
        """A frame that nobody wants: counted is what was lost before it.

        That are numbers which are left out, and what the station did not tell of.
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
        """All that is missing up to a frame is lost: with the process before, where nothing was heard since."""
        gap = total - self.reached.get(interface, 0) - 1
        if self._successor is not None and interface not in self._successor:
            self._successor.add(interface)
            self.lose(interface, max(0, gap))
        else:
            self._lack(interface, max(0, gap))

    def lose(self, interface: str, count: int) -> None:
        """Frames that went with the process before."""
        self.killed += count
        self._lost[interface] += count
        self.gone[interface] += count

    def _lack(self, interface: str, count: int) -> None:
        self.missing += count
        self._lost[interface] += count
        self.gone[interface] += count

    def unwrite(self, count: Mapping[str, int]) -> None:
        """Frames that were given to a stream did not get into its file after all."""
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
