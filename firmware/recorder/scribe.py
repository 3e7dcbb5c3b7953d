"""Frames into pcapng: sections that say whose they are, interfaces with their names, and what is missing."""

from collections import Counter
from collections.abc import Mapping

from firmware import VERSION
from firmware.codec.pcapng import Direction, Pcapng, Stream
from firmware.recorder.told import Told, comment_of, kept_of

# What of a status a recording says of its station.
KNOWN = ("station", "version", "profile", "configuration", "boot", "pid")


class Scribe:
    """Writes what is told; a recording may go on in another stream.

    frames   written. lost: that were not, as far as is known.
    missing  of these, what was lost on the way here.
    """

    def __init__(self) -> None:
        self.frames = 0
        self.lost = 0
        self.missing = 0
        self._about: dict[str, object] = {}
        self._descriptions: dict[str, str] = {}
        self._pcapng: Pcapng | None = None
        self._stream: Stream | None = None
        self._last: dict[str, int] = {}  # sequence by interface
        self._lost: Counter[str] = Counter()  # by interface, since its last frame that was written
        self._written: Counter[str] = Counter()  # of this section
        self._gone: Counter[str] = Counter()
        self._when_ns = 0

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
            if self._stream is not None:
                self.begin(self._stream)

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
            self.lost += 1
            return
        lost = self._lost.pop(told.interface, 0)
        comment = comment_of(told)
        if lost:
            comment = f"{lost} frames before this one are missing; {comment}"
        self._pcapng.interface(told.interface, self._descriptions.get(told.interface, ""))
        direction = Direction.OUT if told.is_out else Direction.IN
        said = kept_of(told.said)
        self._pcapng.add(told.interface, told.when_ns, told.frame, direction, comment, said, lost)
        self.frames += 1
        self._written[told.interface] += 1
        self._gone[told.interface] += lost
        self._when_ns = told.when_ns

    def pass_over(self, told: Told) -> None:
        """A frame that nobody wants: counted is what was lost before it.

        That are numbers which are left out, and what the station did not tell of.
        """
        sequence, missed = told.said.get("sequence"), told.said.get("missed")
        if not isinstance(sequence, int) or not isinstance(missed, int):
            return
        last = self._last.get(told.interface)
        gap = max(0, sequence - last - 1) if last is not None else 0
        self._last[told.interface] = sequence
        self._lost[told.interface] += gap + missed
        self.lost += gap + missed
        self.missing += gap + missed

    def unwrite(self, count: Mapping[str, int]) -> None:
        """Frames that were given to a stream did not get into its file after all."""
        for interface, number in count.items():
            self._lost[interface] += number
            self.frames -= number
            self.lost += number


def _description(status: object) -> str:
    if not isinstance(status, dict):
        return ""
    technology, driver = status.get("technology", ""), status.get("driver", "")
    return f"{technology} by {driver}" if driver else str(technology)
