"""Page of topics of port 5558: the keys of each JSON object, with the meanings that the docstrings of its builders have."""

import re
from collections.abc import Callable, Iterator
from functools import cache
from typing import NamedTuple

from board.board_worker import BoardWorker
from board.health import _Reading
from board.identity import Identity
from board.time.scales import LeapEvent, TimeMark, TimeQuality
from firmware.clock.pulse_input import PulseInput
from firmware.clock.pulsed_time import PulsedTime
from firmware.clock.system_clock import SystemClock
from firmware.clock.timekeeper import Timekeeper
from firmware.codec.decoding import doubt_record, refusal_record
from firmware.endpoint.deliveries import delivery_of
from firmware.endpoint.endpoint import Endpoint
from firmware.endpoint.facilities import Facilities
from firmware.endpoint.frame_report import FrameReport
from firmware.endpoint.report import Report, invalid_of, process_status, said_of
from firmware.facilities.converting import Converter
from firmware.facilities.exchange import reception_of
from firmware.recorder.ring import Ring
from firmware.routing.drops import Drop, Drops
from firmware.routing.duplicates import Duplicates
from firmware.routing.implausible import ImplausibleCounts
from firmware.routing.interface import Interface
from firmware.routing.paths import Paths
from firmware.routing.policy import Policy
from firmware.slots.supervisor import SlotSupervisor
from firmware.station.carrier import Carrier
from firmware.station.interface_supervisor import InterfaceSupervisor
from firmware.station.position import OwnPosition, _told
from firmware.station.recording import Recorder
from firmware.station.signatures import Signatures
from firmware.station.station import Station
from firmware.station.storage import Storage
from pps.chrony.feed import Refclock
from pps.chrony.tracking import Tracking
from tests.documents import anchor
from tests.reference.meanings import meanings
from tests.reference.page import Page, Section, sentence, table

NONE = re.compile(r"\bNone\b")  # in JSON: null
SUMMARY = "JSON objects on port 5558. Subscribe to the first words of a topic, such as `confirm.` or `confirm.cam.`."
AT_ONCE = (
    "They are sent together, ten times a second; with a label or a reason within 10 ms; and at once while a user "
    "subscribes to `soon.`."
)
LISTED = (
    "The objects are made only while a user subscribes. In a flood, above 4,000 a second (1,000 after a second of ten "
    "times as many), messages without a label or a reason are only numbered."
)


class Source(NamedTuple):
    """A docstring with meanings of keys.

    prefix   of the rows that count, such as "pulse."; empty: all but those of nested objects.
    without  rows that the object does not have.
    """

    of: type | Callable[..., object]
    prefix: str = ""
    without: frozenset[str] = frozenset()

    def rows(self) -> dict[str, str]:
        rows = meanings(self.of)
        if self.prefix:
            rows = {key.removeprefix(self.prefix): text for key, text in rows.items() if key.startswith(self.prefix)}
        return {key: text for key, text in rows.items() if key not in self.without and not _is_nested(key, rows)}


class Part(NamedTuple):
    """A JSON object.

    path    its place, from the topic on: `status.interfaces.*`; `*` is any name, `[]` any row.
    nested  objects below it, each by the key that has it.
    """

    title: str
    path: str
    sources: tuple[Source, ...]
    text: str = ""

    def rows(self) -> dict[str, str]:
        """Return the meaning of each key; the first source that has a key counts."""
        found: dict[str, str] = {}
        for rows in (source.rows() for source in self.sources):
            found |= {key: text for key, text in rows.items() if key not in found}
        return found


def _of(*sources: type | Callable[..., object]) -> tuple[Source, ...]:
    return tuple(map(Source, sources))


_CLOCK = (
    Source(Timekeeper.status),
    Source(TimeQuality, without=frozenset({"source", "leap"})),
    Source(PulsedTime.status),
)
PARTS = (
    Part(
        "confirm",
        "confirm",
        _of(Report._confirm_of),
        f"Topic `confirm.<type>.`: what became of a request. {LISTED} {AT_ONCE}",
    ),
    Part(
        "indication",
        "indication",
        _of(Report.indication_of),
        f"Topic `indication.<type>.`: every message that an interface has received, also copies of one that another interface delivered first. {LISTED} {AT_ONCE}",
    ),
    Part(
        "implausible",
        "implausible",
        _of(Report.indication_of),
        "Topic `implausible.<type>.`: the same object for each implausible message, at once, at most 100 a second. `sequence` counts only these, with those that are not sent.",
    ),
    Part("confirm: invalid", "confirm.invalid[]", _of(invalid_of)),
    Part(
        "message",
        "message",
        _of(delivery_of, reception_of),
        "Topic `message.<type>.`: every message that was delivered on port 5556, with its metadata; `message..` for a message without a known type. The third frame of the ZeroMQ message is the PDU. They are sent only to users whose subscription begins with `message.`. Above 8,000 of a type per second they are only numbered.",
    ),
    Part(
        "json, plain",
        "json",
        _of(Converter.convert, doubt_record, refusal_record),
        "Topics `json.<type>.` and `plain.<type>.`: received messages in JSON, once each; `json..` and `plain..` for a message without a known type. In `plain.`, numbers are in SI units and degrees. They are sent only to users whose subscription begins with `json.` or `plain.`; the first one starts the process that decodes, which takes half a second.",
    ),
    Part("json: reception", "json.reception", _of(reception_of)),
    Part("quality", "*.quality", _of(said_of), "Member `quality` of confirms, indications and frames."),
    Part(
        "frame",
        "frame",
        _of(FrameReport.of),
        "Topic `frame.<interface>.`: every frame that came or left, 50 ms later. The third frame of the ZeroMQ message is the Ethernet frame. They are sent only to users whose subscription begins with `frame.`.",
    ),
    Part(
        "status",
        "status",
        _of(Station.status, process_status, Endpoint.status),
        "Topic `status.`, once a second; `captain status --json` prints it at any time.",
    ),
    Part("status: position", "status.position", _of(OwnPosition.status, _told)),
    Part(
        "status: position: time_mark",
        "status.position.time_mark",
        (Source(OwnPosition._time_mark), Source(TimeMark, without=frozenset({"monotonic"}))),
    ),
    Part("status: position: time_mark: leap_event", "status.position.time_mark.leap_event", _of(LeapEvent)),
    Part("status: storage", "status.storage", _of(Storage.status)),
    Part("status: interfaces", "status.interfaces.*", _of(InterfaceSupervisor.status, Interface.status)),
    Part(
        "status: interfaces: implausible",
        "status.interfaces.*.implausible[]",
        _of(ImplausibleCounts.status, Drop.status),
    ),
    Part("status: board", "status.board", _of(Carrier.status)),
    Part("status: board: identity", "status.board.identity", _of(Identity)),
    Part("status: board: slots", "status.board.slots.*", _of(Carrier.listed, SlotSupervisor.status)),
    Part("status: board: rails", "status.board.rails.*", _of(_Reading.status)),
    Part("status: board: temperatures", "status.board.temperatures.*", _of(_Reading.status)),
    Part("status: board: fan", "status.board.fan", _of(_Reading.status)),
    Part("status: board: worker", "status.board.worker", _of(BoardWorker.status)),
    Part("status: facilities", "status.facilities", _of(Facilities.status)),
    Part("status: recorder", "status.recorder", _of(Recorder.status, Ring.status)),
    Part("status: security", "status.security", _of(Signatures.status)),
    Part("status: drops", "status.drops[]", _of(Drops.status, Drop.status), "The reasons: [drop reasons](drops.md)."),
    Part("status: duplicates", "status.duplicates", _of(Duplicates.status, Paths.status)),
    Part("status: duplicates: paths", "status.duplicates.paths[]", _of(Paths._rows)),
    Part("status: policy", "status.policy[]", _of(Policy.status)),
    Part("time", "time", _CLOCK, "Topic `time.`, once a second; also member `clock` of `status.`."),
    Part("time: leap", "time.leap", _of(Timekeeper._leap_status)),
    Part("time: leap: event", "time.leap.event", (*_of(LeapEvent), Source(Timekeeper._leap_status, "event."))),
    Part("time: pulse", "time.pulse", (*_of(PulseInput.status), Source(PulsedTime.status, "pulse."))),
    Part("time: pulse: refused", "time.pulse.refused[]", (Source(PulsedTime.status, "pulse.refused."),)),
    Part("time: refclock", "time.refclock", _of(Refclock.status)),
    Part("time: tracking", "time.tracking", _of(SystemClock.status, Tracking)),
)
# Objects whose keys are names: of interfaces, types, sockets or fates.
MAPS = frozenset({
    "status.interfaces", "status.interfaces.*.received", "status.interfaces.*.sent",
    "status.board.slots", "status.board.rails", "status.board.temperatures",
    "status.endpoint.connections", "status.report.frames",
    "status.duplicates.first", "status.duplicates.lead_ms", "status.duplicates.paths[].first",
    "status.duplicates.paths[].lead_ms", "status.duplicates.paths[].alone", "time.refclock.samples",
})  # fmt: skip
OPAQUE = frozenset({"status.interfaces.*.details", "json.message", "confirm.invalid[].value"})  # of a driver, a message
ELSEWHERE = {"status.clock": "time", "plain": "json", "json.reception.quality": "*.quality"} | {
    f"{name}.quality": "*.quality" for name in ("confirm", "indication", "implausible", "frame", "message")
}


def undocumented(topic: str, said: object) -> list[str]:
    """Return the place of each key of an object that has no meaning here; topic is its first word, as `status`."""
    return list(_undocumented(said, topic, topic))


def _undocumented(said: object, path: str, place: str) -> Iterator[str]:
    """place: the same path, with the names that the object has."""
    path = ELSEWHERE.get(path, path)
    if isinstance(said, list):
        for one in said:
            yield from _undocumented(one, f"{path}[]", f"{place}[]")
    elif isinstance(said, dict) and path in MAPS:
        for name, one in said.items():
            yield from _undocumented(one, f"{path}.*", f"{place}.{name}")
    elif isinstance(said, dict) and path not in OPAQUE:
        known = _rows().get(path, frozenset())
        for key, one in said.items():
            if f"{path}.{key}" not in known:
                yield f"{place}.{key}"
            yield from _undocumented(one, f"{path}.{key}", f"{place}.{key}")


@cache
def _rows() -> dict[str, set[str]]:
    """Paths of the keys of each object, by its path; `queue.length` is a key of two objects."""
    found: dict[str, set[str]] = {}
    for part in PARTS:
        above = part.path.split(".")
        for row in part.rows():
            names = row.split(".")
            for end in range(len(names)):
                path = ".".join([*above, *names[:end]])
                found.setdefault(path, set()).add(f"{path}.{names[end]}")
    return found


def page() -> Page:
    made = Page("topics", "Report topics", SUMMARY, [])
    for part in PARTS:
        links = {_key(one, part): one.title for one in PARTS if _key(one, part)}
        rows = [
            (f"`{key}`", sentence(NONE.sub("null", text)) + _link(links.get(key))) for key, text in part.rows().items()
        ]
        level = 2 + part.title.count(": ")
        made.sections.append(Section(part.title, f"{part.text}\n\n{table(('key', 'meaning'), rows)}", min(level, 4)))
    return made


def _key(part: Part, above: Part) -> str:
    """The key by which an object has another; empty if it has it not."""
    path, ends = part.path.replace(".*", "").replace("[]", ""), above.path.replace("[]", "")
    parent, _, key = path.rpartition(".")
    if part.path == "*.quality":
        return "quality" if above.path in ("confirm", "indication", "implausible", "frame") else ""
    if part.path == "time" and above.path == "status":
        return "clock"
    return key if parent == ends.replace(".*", "") and part is not above else ""


def _link(title: str | None) -> str:
    return f" [Keys](#{anchor(title)})." if title else ""


def _is_nested(key: str, rows: dict[str, str]) -> bool:
    """A dotted row of an object that has a section of its own; without a row of its own, it has none."""
    parts = key.split(".")
    return any(".".join(parts[:end]) in rows for end in range(1, len(parts)))
