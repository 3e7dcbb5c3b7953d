"""Text of the serial console: facts to sections, the most urgent first."""

import textwrap
import time
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from firmware import VERSION
from firmware.client.show.status import board, clock, storage
from firmware.client.show.status.clock import LAST_TIME
from firmware.client.show.table import Table, plain, span, times
from firmware.console.addresses import AddressedDevice
from firmware.console.journal import Trouble
from firmware.console.rates import Rate
from firmware.printable import clean
from firmware.untrusted import listed, named, number, text, texts, within

NOTES_ABOVE = 8  # most lines of notes on the first page; the last page has all
FOLDED = 3  # most lines for one error or drop
DROPS = 5
DEVICES = 12
UNSET = "the clock of this machine is NOT SET: all time stamps are wrong"
OPEN = "open to every program that reaches these addresses, without authentication"

Status = Mapping[str, object]
Section = list[str]


class Facts(NamedTuple):
    """Facts for one screen.

    status      status of the station; empty without an answer.
    why         why no station answers.
    service     state of the station's service, or how to start it.
    last_words  last error that the station logged before its end.
    remedy      remedy if no station answers.
    rates       message rates by interface.
    devices     network devices with their addresses.
    is_open     other machines reach the endpoint.
    notes       notes of the start of this machine.
    troubles    errors of the journal, the newest first.
    unread      why the journal could not be read; else empty.
    now         Unix time in seconds.
    """

    status: Status
    why: str
    service: str
    last_words: str
    remedy: str
    rates: Mapping[str, Rate]
    devices: Sequence[AddressedDevice]
    is_open: bool
    notes: Sequence[str]
    troubles: Sequence[Trouble]
    unread: str
    now: float


def head(facts: Facts) -> str:
    """Return the first line: station, version, uptime, and the machine's clock."""
    status = facts.status
    day = time.strftime("%Y-%m-%d %H:%M:%S UTC", time.gmtime(min(max(0.0, facts.now), LAST_TIME)))
    if not status:
        return f"captain {VERSION}  no station  {day}"
    return f"{text(status, 'station')}  captain {text(status, 'version')}  up {span(number(status, 'uptime_s'))}  {day}"


def sections(facts: Facts, width: int) -> list[Section]:
    """Return sections of ASCII lines, at most `width` wide; no section is empty."""
    made = [
        _notes(facts.notes[:NOTES_ABOVE], len(facts.notes) - NOTES_ABOVE, width),
        *(_of_station(facts, width) if facts.status else [_nobody(facts, width)]),
        _addresses(facts, width),
        _troubles(facts, width),
        _in_full(facts, width),
        _notes(facts.notes, 0, width) if len(facts.notes) > NOTES_ABOVE else [],
    ]
    return [[shown(line, width) for line in section] for section in made if section]


def shown(line: str, width: int) -> str:
    """Return a line that every terminal can show: ASCII without control characters, at most `width` wide."""
    return clean(line).encode("ascii", "replace").decode()[:width]


def _notes(lines: Sequence[str], more: int, width: int) -> Section:
    folded = [part for line in lines for part in _folded(f"! {line}", width)]
    return [*folded, *([f"! {more} more lines on the last page"] if more > 0 else [])]


def _nobody(facts: Facts, width: int) -> Section:
    ended = f"its last words: {facts.last_words}" if facts.last_words else ""
    return [line for said in (facts.why, facts.service, ended, facts.remedy) for line in _folded(said, width)]


def _of_station(facts: Facts, width: int) -> Iterator[Section]:
    status = facts.status
    unset = UNSET if status.get("is_clock_set") is False else ""
    troubles = storage.trouble(within(status, "storage")), storage.recorder_trouble(within(status, "recorder"))
    known = (unset, *troubles, _time(status), _place(within(status, "position")))
    yield [part for line in known for part in _folded(line, width)]
    told = within(status, "board")
    if told:
        yield plain(_slots(told), width)
        yield _folded(_board(told), width)
    yield plain(_interfaces(facts), width)
    yield _folded(_users(status), width)


def _time(status: Status) -> str:
    told = within(status, "clock")
    return clock.title(told) if told else "time: not reported by the station"


def _place(position: Status) -> str:
    if not text(position, "source"):
        return "position unknown"
    words = [
        f"position {number(position, 'latitude'):.7f} {number(position, 'longitude'):.7f}",
        f"by {text(position, 'source')}",
    ]
    if text(position, "fix"):
        words += [
            f"fix {text(position, 'fix')}, carrier {text(position, 'carrier')}",
            f"{number(position, 'satellites'):.0f} satellites",
            f"within {number(position, 'horizontal_m'):.2f} m",
        ]
    if number(position, "age_s") >= 2:
        words.append(f"{span(number(position, 'age_s'))} ago")
    return ", ".join(words)


def _slots(told: Status) -> Table:
    rows, notes = [], []
    for name, one in named(told, "slots"):
        state = text(one, "state")
        device = f"{text(one, 'device') or 'none'} {text(one, 'title')}".rstrip()
        rows.append((f"{number(one, 'number'):.0f}", name, _power(one), state, span(number(one, "since_s")), device))
        if state not in ("running", "unused"):
            notes.append(f"{name}: {text(one, 'cause') or text(one, 'why')}")
    return Table("" if rows else "no slots", (">slot", "name", "power", "state", ">for", "device"), rows, notes)


def _board(told: Status) -> str:
    """Return the board's measurements in words, and the error if its worker does not run."""
    worker = within(told, "worker")
    runs = [] if worker.get("is_up") is True else [f"worker not running: {text(worker, 'why')}"]
    measured = [f"{name or kind} {values}" for kind, name, values, _ in board.measured(told)]
    return f"board {text(told, 'name')}: {', '.join([*runs, *measured]) or 'nothing is measured'}"


def _power(slot: Status) -> str:
    """Return the power state of a slot; one without a switch has power as long as the board."""
    if text(slot, "switched_by").startswith("nothing"):
        return "always"
    return {"off": "off", "fault": "?"}.get(text(slot, "sequence"), "on")


def _interfaces(facts: Facts) -> Table:
    dropped: dict[str, float] = {}
    for drop in listed(facts.status, "drops"):
        dropped[text(drop, "where")] = dropped.get(text(drop, "where"), 0.0) + number(drop, "count")
    rows = []
    for name, one in named(facts.status, "interfaces"):
        rate = facts.rates.get(name)
        rates = (f"{rate.received:.1f}", f"{rate.sent:.1f}") if rate else ("-", "-")
        rows.append(
            (
                name,
                text(one, "driver"),
                text(one, "state"),
                span(number(one, "since_s")),
                *rates,
                f"{dropped.get(name, 0.0):.0f}",
                text(one, "why"),
            )
        )
    heads = ("interface", "driver", "link", ">for", ">in/s", ">out/s", ">drops", "why")
    return Table("" if rows else "no interfaces", heads, rows)


def _users(status: Status) -> str:
    endpoint = within(status, "endpoint")
    slow = "; one does NOT KEEP UP" if number(endpoint, "slow_since") > 0 else ""
    return (
        f"users: {number(endpoint, 'requests'):.0f} requests, {number(endpoint, 'published'):.0f} messages to them"
        f"{slow}; CPU {number(status, 'cpu_s'):.1f} s, {number(status, 'memory_kb') / 1024:.0f} MB"
    )


def _addresses(facts: Facts, width: int) -> Section:
    lines = [line for one in facts.devices[:DEVICES] for line in _folded(_device(one), width)]
    if (more := len(facts.devices) - DEVICES) > 0:
        lines.append(f"{more} more network devices")
    if facts.is_open:
        lines += _folded(OPEN, width)
    return lines or ["no network device"]


def _device(one: AddressedDevice) -> str:
    return f"{one.name:6} {one.state:7} {' '.join(one.addresses) or 'no address'}"


def _troubles(facts: Facts, width: int) -> Section:
    found = [f"WRONG: {complaint}" for complaint in texts(within(facts.status, "board"), "complaints")]
    drops = sorted(listed(facts.status, "drops"), key=lambda drop: -number(drop, "time"))
    found += [_drop(drop, facts.now) for drop in drops[:DROPS]]
    found += [_logged(one) for one in facts.troubles]
    if facts.unread:
        found.append(facts.unread)
    none = [] if facts.last_words else ["no drops, no errors"]
    return [line for one in found for line in _folded(one, width)[:FOLDED]] or none


def _drop(drop: Status, now: float) -> str:
    ago = span(max(0.0, now - number(drop, "time")))
    detail = f" ({text(drop, 'detail')})" if text(drop, "detail") else ""
    return (
        f"{text(drop, 'where')} dropped {times(number(drop, 'count'))}, {ago} ago: "
        f"{text(drop, 'reason')}: {text(drop, 'meaning')}{detail}"
    )


def _logged(one: Trouble) -> str:
    moment = time.strftime("%H:%M:%S", time.gmtime(min(max(0.0, one.time), LAST_TIME)))
    return f"{moment} {one.who}{': ' if one.who else ''}{one.text}"


def _in_full(facts: Facts, width: int) -> Section:
    """Return the complete reason texts of interfaces whose table cell was too narrow for them."""
    table = "\n".join(plain(_interfaces(facts), width))
    return [
        line
        for name, one in named(facts.status, "interfaces")
        if clean(text(one, "why")) not in table
        for line in _folded(f"{name}: {text(one, 'why')}{_hint(one)}", width)
    ]


def _hint(one: Status) -> str:
    return f" ({text(one, 'hint')})" if text(one, "hint") else ""


def _folded(line: str, width: int) -> Section:
    return textwrap.wrap(clean(line), width, subsequent_indent="  " if width > 20 else "")
