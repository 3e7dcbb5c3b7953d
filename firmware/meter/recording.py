"""Measurement of two recordings of `captain record`, or of other captures."""

import math
import statistics
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

from board.runtime.errors import ProtocolError, StationError
from drivers.message import Position
from firmware import file_remedy
from firmware.meter.event import NO_CLOCK, Clock, ReceivedEvent, Sent, What, what_of
from firmware.meter.meter import Meter
from firmware.meter.sender_position import position_of
from firmware.meter.watch import status_fields
from firmware.recordings import capture, layers
from firmware.recordings.pcapng import Direction
from firmware.topics import Topics
from firmware.untrusted import number, text, within

# Limit of frames in one file: ten minutes of four full channels, with 0.5 kB each.
MOST_FRAMES = 4_000_000
SETTLE_S = 1.0
BOTH_WAYS = frozenset({"", "duplicate"})  # reasons of dropped frames that had nevertheless arrived


class Recording(NamedTuple):
    """Content of one recording.

    name            name of the station in the measurement.
    path            file.
    sent, received  messages in their order; at_s is by the recorder's clock.
    interfaces      technology of each interface; empty if the file does not contain it.
    span            first and last time in seconds.
    missed          gaps of the recording: number of frames, and the times before and after.
    not_sent        interface and reason of each message that was not sent.
    said            recorder's description: station, version, configuration.
    is_plain        frames without a direction.
    broken          reason why the file ends early, for example after a power failure; empty if it is whole.
    positions       sender's position by digest.
    left_out        frames of another program's capture that carry no message, by kind.
    """

    name: str
    path: Path
    sent: list[Sent]
    received: list[ReceivedEvent]
    interfaces: dict[str, str]
    span: tuple[float, float]
    missed: list[tuple[int, float, float]]
    not_sent: list[tuple[str, str]]
    said: Mapping[str, object]
    is_plain: bool
    broken: str
    positions: dict[str, Position]
    left_out: Counter[str]


def read(path: Path, name: str, is_first: bool) -> Recording:
    """Read a recording; frames without direction count as sent in the first file and as received in the second.

    Raises StationError if the file cannot be read or is not a capture.
    """
    try:
        with path.open("rb") as stream:
            head = stream.read(4)
            if not capture.is_capture(head):
                raise StationError(f"{path}: not a capture", "record one: captain record --pcapng FILE")
            return _Reading(path, name, is_first).all(capture.frames(head, stream))
    except OSError as error:
        raise StationError(f"{path}: {error.strerror}", file_remedy.to_read(error)) from error
    except ProtocolError as error:
        raise StationError(f"{path}: {error.message}", error.hint) from error


class _Reading:
    def __init__(self, path: Path, name: str, is_first: bool) -> None:
        self._path = path
        self._name = name
        self._is_first = is_first
        self._broken = ""
        self._made = Recording(name, path, [], [], {}, (0.0, 0.0), [], [], {}, False, "", {}, Counter())
        self._types = Topics().by_number

    def all(self, frames: Iterator[capture.Frame]) -> Recording:
        moments: list[float] = []
        is_plain, said = False, self._made.said
        for frame in self._whole(frames):
            if frame.when_ns is None:
                continue
            moments.append(frame.when_ns / 1e9)
            if frame.lost:
                self._made.missed.append((frame.lost, moments[-2] if len(moments) > 1 else moments[0], moments[-1]))
            is_plain |= frame.direction is Direction.UNKNOWN
            said = frame.recording or said
            self._made.interfaces.setdefault(_interface(frame), frame.description.partition(" by ")[0])
            self._take(frame, text(said, "boot"))
            if frame.number >= MOST_FRAMES:
                raise StationError(f"{self._path}: more than {MOST_FRAMES} frames", "cut it: `editcap -c`")
        span = (min(moments), max(moments)) if moments else (0.0, 0.0)
        return self._made._replace(span=span, is_plain=is_plain, broken=self._broken, said=said)

    def _whole(self, frames: Iterator[capture.Frame]) -> Iterator[capture.Frame]:
        """Yield frames up to a truncated one. Raises ProtocolError if even the first frame is malformed."""
        has_one = False
        try:
            for frame in frames:
                yield frame
                has_one = True
        except ProtocolError as error:
            if not has_one:
                raise
            self._broken = error.message

    def _take(self, frame: capture.Frame, boot: str) -> None:
        what = self._what(frame)
        if what is None:
            return
        assert frame.when_ns is not None
        reason = text(frame.said, "reason")
        clock = status_fields.clock_of(within(frame.said, "quality"), boot) if frame.said else NO_CLOCK
        interface, at_s = _interface(frame), frame.when_ns / 1e9
        is_out = frame.direction is Direction.OUT or (frame.direction is Direction.UNKNOWN and self._is_first)
        if is_out and reason:
            self._made.not_sent.append((interface, reason))
        elif is_out:
            self._made.sent.append(_sent(self._name, interface, what, frame, clock))
        elif reason in BOTH_WAYS:
            one = ReceivedEvent(
                self._name, interface, what, frame.when_ns, clock, at_s, status_fields.rssi_of(frame.said)
            )
            self._made.received.append(one)

    def _what(self, frame: capture.Frame) -> What | None:
        """Return the message of a frame; None if it carries none or is malformed."""
        try:
            carried = layers.open_frame(frame.link, frame.octets)
        except ProtocolError:
            carried = layers.NoMessage("that are broken")
        if isinstance(carried, layers.NoMessage):
            if not frame.said:
                self._made.left_out[carried.what] += 1
            return None
        if len(carried.pdu) < 6:
            return None
        what = what_of(carried.pdu, self._types[carried.pdu[1]].name)
        if (position := position_of(carried.pdu)) is not None:
            self._made.positions[what.digest] = position
        return what


def _interface(frame: capture.Frame) -> str:
    return frame.interface or "capture"


def _sent(name: str, interface: str, what: What, frame: capture.Frame, clock: Clock) -> Sent:
    assert frame.when_ns is not None
    queue_ns, send_ns = (round(number(frame.said, key) * 1000) for key in ("queue_us", "send_us"))
    accepted_ns = frame.when_ns - queue_ns - send_ns
    return Sent(name, interface, what, accepted_ns, queue_ns, send_ns, clock, frame.when_ns / 1e9)


def _who(one: Recording) -> tuple[str, float] | None:
    """Return boot id and process id of the recorded station; None if the file does not contain them."""
    boot, pid = text(one.said, "boot"), number(one.said, "pid")
    return (boot, pid) if boot and pid else None


class Laid(NamedTuple):
    """Result of aligning two recordings in time.

    uncovered  sent messages outside the time of the other recording.
    notes      notes for the reader.
    """

    uncovered: int
    notes: list[str]


def measure(meter: Meter, one: Recording, other: Recording) -> Laid:
    """Feed two recordings to a meter, and settle all messages.

    Raises StationError if both are of one station, share no direction, or cannot be aligned in time.
    """
    if one.path.samefile(other.path) or (_who(one) is not None and _who(one) == _who(other)):
        raise StationError(f"{one.path} and {other.path} are of the same station", "name a recording of each end")
    ahead_s, how = _ahead(one, other)
    notes = [f"{other.name}'s clock is assumed {ahead_s:+.6f} s ahead of {one.name}'s: {how}"] if how else []
    for name, recording in ((one.name, one), (other.name, other)):
        meter.station(name, recording.interfaces)
        if missed := sum(count for count, _, _ in recording.missed):
            notes.append(f"{recording.path}: {missed} frames that its recorder did not have")
        for interface, reason in recording.not_sent:
            meter.inside.not_sent(name, interface, reason)
        for digest, position in recording.positions.items():
            meter.spots.note_message(digest, position)
    if not any(way.sender != way.receiver for way in meter.ways):
        raise StationError(
            f"no interface of {one.path} ({', '.join(one.interfaces) or 'it has none'}) is known to hear one of "
            f"{other.path} ({', '.join(other.interfaces) or 'it has none'})",
            f"--between {one.name}:INTERFACE={other.name}:INTERFACE says which do",
        )
    for recording, shift in ((one, 0.0), (other, ahead_s)):
        meter.hears(recording.name, recording.span[0] - shift)
        meter.silent(recording.name, recording.span[1] - shift)
        for count, since, until in recording.missed:
            meter.unheard(recording.name, count, since - shift, until - shift)
            meter.silent(recording.name, since - shift, until - shift)
    uncovered = 0
    events: list[Sent | ReceivedEvent] = []
    for recording, against, shift in ((one, other, 0.0), (other, one, ahead_s)):
        since, until = (moment + (ahead_s if against is one else -ahead_s) for moment in against.span)
        heard_there = {heard.what.digest for heard in against.received}
        for event in recording.sent:
            if since <= event.at_s <= until or event.what.digest in heard_there:
                events.append(event._replace(at_s=event.at_s - shift))
            else:
                uncovered += 1
        events += [heard._replace(at_s=heard.at_s - shift) for heard in recording.received]
    _feed(meter, events)
    meter.finish()
    if uncovered:
        notes.append(
            f"{uncovered} messages are not counted: they were sent before the other end's first frame or after its last"
        )
    return Laid(uncovered, notes)


def _feed(meter: Meter, events: list[Sent | ReceivedEvent]) -> None:
    """Feed events to the meter in order of time, and settle on the way, because the meter keeps a limited number."""
    settled_s = -math.inf
    for event in sorted(events, key=lambda event: event.at_s):
        if event.at_s > settled_s + SETTLE_S:
            settled_s = event.at_s
            meter.settle(settled_s)
        if isinstance(event, Sent):
            meter.sent(event)
        else:
            meter.received(event)


def _ahead(one: Recording, other: Recording) -> tuple[float, str]:
    """Return how far the second recording's clock is ahead, in seconds, and a text that says how this is known.

    The text is empty if both have the same clock. Raises StationError if the difference is unknown and repeated
    messages cannot be told apart without it.
    """
    boots = {text(recording.said, "boot") for recording in (one, other)}
    if len(boots) == 1 and "" not in boots:
        return 0.0, ""
    offsets = [_offset_ns(recording) for recording in (one, other)]
    if offsets[0] is not None and offsets[1] is not None:
        return (offsets[0] - offsets[1]) / 1e9, "both recordings state their clock error"
    there, back = _differences(one, other), _differences(other, one)
    if there and back:
        return (statistics.median(there) - statistics.median(back)) / 2, "half of both directions' difference"
    if there:
        return statistics.median(there), "the delay of messages is assumed to be zero"
    if back:
        return -statistics.median(back), "the delay of messages is assumed to be zero"
    if _have_in_common(one, other):
        raise StationError(
            f"{one.path}, {other.path}: their clock errors are unknown, and no message that was sent only once shows "
            "the difference of the clocks",
            "record stations with known clocks, or messages that differ, as --probe sends them",
        )
    return 0.0, "unknown, because no message of one recording is in the other"


def _offset_ns(one: Recording) -> float | None:
    """Return the median of the clock offset that a station reported, in ns; None if it never knew it."""
    clocks = [event.clock for event in one.sent] + [event.clock for event in one.received]
    known = [clock.offset_ns for clock in clocks if clock.offset_ns is not None]
    return statistics.median(known) if known else None


def _have_in_common(one: Recording, other: Recording) -> bool:
    return any(
        not {event.what.digest for event in sender.sent}.isdisjoint(heard.what.digest for heard in receiver.received)
        for sender, receiver in ((one, other), (other, one))
    )


def _differences(one: Recording, other: Recording) -> list[float]:
    """Return the differences of reception and sending time in seconds, of messages that were sent once."""
    moments: dict[str, float | None] = {}
    for event in one.sent:
        moments[event.what.digest] = None if event.what.digest in moments else event.at_s
    return [heard.at_s - at_s for heard in other.received if (at_s := moments.get(heard.what.digest)) is not None]


def told_of(one: Recording) -> dict[str, object]:
    """Return the description of a recorded station for a report."""
    said = one.said
    notes = []
    if one.is_plain:
        notes.append("frames have no direction: those of the first file count as sent, of the second as received")
    notes += [f"{count} frames {what}: not measured" for what, count in one.left_out.items()]
    if one.broken:
        notes.append(f"{one.broken}: only frames before this fault are measured")
    return {
        "where": str(one.path),
        "station": text(said, "station"),
        "version": text(said, "version"),
        "configuration": text(said, "configuration"),
        "boot": text(said, "boot"),
        "time": "",
        "uncertainty_us": None,
        "clock": [],
        "interfaces": dict(one.interfaces),
        "missed_frames": sum(count for count, _, _ in one.missed),
        "notes": notes,
    }
