"""captain status: shows interfaces, counters and drops of a station."""

import argparse
import json
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from board.runtime.errors import StationError
from firmware.client import client
from firmware.client.arguments import add_socket, add_station, address
from firmware.client.show.status import board, clock, storage
from firmware.client.show.table import Screen, Table, span, times
from firmware.station.signatures import UNVERIFIED
from firmware.untrusted import listed, named, number, text, total, within

WATCH_S = 1.0  # interval in seconds at which a station publishes its status
LAST_TIME = 253402300799.0  # 9999-12-31, the last date that datetime supports

DESCRIPTION = """\
Shows the state of a station: its interfaces, links and queues, messages per
type, drops with their reasons, duplicates, and matches of the policy.

The status of a station on this machine comes from its control socket. That of
another one comes from its report port, once a second.
"""
EPILOG = """\
examples:
  captain status                           the station of this machine
  captain status --watch                   every second, until Ctrl-C
  captain status --station 192.168.1.20    a station on another machine, with
                                           endpoint.address = "0.0.0.0"
  captain status --json | jq .drops        for programs

exit codes:
  0    the station answered
  1    no station answers
  2    wrong usage
  130  Ctrl-C
"""


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--json", action="store_true", help="one JSON object, as published under `status.`")
    parser.add_argument("--watch", action="store_true", help="repeat every second")
    add_socket(parser)
    add_station(parser)


def main(arguments: argparse.Namespace) -> int:
    """Show the status of a station, once or repeatedly. Raises StationError if it stops publishing."""
    place = address(arguments)
    if not arguments.watch:
        _show(client.status(place, arguments.control), arguments.json, None)
        return 0
    with Screen(all_by="captain status | less") as screen:
        for status in _asked(Path(arguments.control)) if arguments.control else _statuses(place):
            _show(status, arguments.json, screen)
    return 0


def _asked(control: Path) -> Iterator[dict[str, object]]:
    """Yield a status from a control socket every WATCH_S. Raises StationError if no station answers."""
    while True:
        yield client.station_status(control)
        time.sleep(WATCH_S)


def _statuses(place: client.Address) -> Iterator[dict[str, object]]:
    """Yield each status that the station publishes. Raises StationError if it stops."""
    with client.session() as context:
        subscriber = client.subscribe(context, place, place.report, "status.")
        while (status := client.next_report(subscriber, "status.")) is not None:
            yield status
    raise StationError(
        f"no status from {place.host}:{place.report} for {client.ANSWER_S:g} s",
        "check that the station runs: captain doctor",
    )


def _show(status: dict[str, object], is_json: bool, screen: Screen | None) -> None:
    if is_json:
        print(json.dumps(status), flush=True)
    else:
        (screen or Screen()).show(tables(status, time.time()))


# -- the tables of one status; missing and malformed values are shown as 0 or empty


def tables(status: Mapping[str, object], now: float) -> list[Table]:
    """Return the tables of a status; now: Unix time in seconds.

    Problems and short tables come first, because a small terminal cannot show all.
    """
    return [
        Table(_station(status)),
        *_storage(status),
        _interfaces(status),
        _drops(status, now),
        *_implausible(status, now),
        *_security(status),
        Table(_endpoint(status)),
        *_reports(status),
        _duplicates(status),
        _policy(status),
        *board.section(status),
        *_time(status),
        _traffic(status),
        *_paths(status),
    ]


def _station(status: Mapping[str, object]) -> str:
    return (
        f"{text(status, 'station')}: captain {text(status, 'version')}, profile {text(status, 'profile')}, "
        f"pid {number(status, 'pid'):.0f}, up {span(number(status, 'uptime_s'))}, "
        f"CPU {number(status, 'cpu_s'):.1f} s, {number(status, 'memory_kb') / 1024:.0f} MB"
    )


def _storage(status: Mapping[str, object]) -> list[Table]:
    """Return a table only if files are not kept, writes were refused, or the recorder does not record."""
    troubles = storage.trouble(within(status, "storage")), storage.recorder_trouble(within(status, "recorder"))
    return [Table(trouble) for trouble in troubles if trouble]


def _security(status: Mapping[str, object]) -> list[Table]:
    """Return a table only if signed messages were delivered. Dropped ones are in the table of drops."""
    security = within(status, "security")
    delivered = number(security, "delivered")
    if not delivered or security.get("verifies") is not False:
        return []
    return [Table(f"security: {UNVERIFIED}; {delivered:.0f} signed messages delivered as unverifiable-pkt")]


def _interfaces(status: Mapping[str, object]) -> Table:
    rows, notes = [], []
    for name, one in named(status, "interfaces"):
        queue = within(one, "queue")
        rows.append(
            (
                name,
                text(one, "driver"),
                text(one, "state"),
                span(number(one, "since_s")),
                f"{total(one, 'received'):.0f}",
                f"{total(one, 'sent'):.0f}",
                f"{number(queue, 'length'):.0f}/{number(queue, 'capacity'):.0f}",
                f"{number(queue, 'longest'):.0f}",
                f"{number(one, 'neighbours'):.0f}",
            )
        )
        restarts = number(one, "restarts")
        notes.append(f"{name}: {text(one, 'why')}" + (f"; started again {times(restarts)}" if restarts else ""))
    heads = ("interface", "driver", "link", ">for", ">received", ">sent", ">queue", ">max", ">heard")
    return Table("interfaces" if rows else "no interfaces", heads, rows, notes)


def _time(status: Mapping[str, object]) -> list[Table]:
    told = within(status, "clock")
    return [Table(clock.title(told))] if told else []


def _traffic(status: Mapping[str, object]) -> Table:
    rows = []
    for name, one in named(status, "interfaces"):
        received, sent = within(one, "received"), within(one, "sent")
        rows += [
            (name, kind or "(no name)", f"{number(received, kind):.0f}", f"{number(sent, kind):.0f}")
            for kind in sorted({*received, *sent})
        ]
    return Table("messages" if rows else "no messages yet", ("interface", "type", ">received", ">sent"), rows)


def _endpoint(status: Mapping[str, object]) -> str:
    endpoint = within(status, "endpoint")
    counts = ", ".join(
        f"{words} {number(endpoint, key):.0f}"
        for words, key in (
            ("requests", "requests"),
            ("accepted", "accepted"),
            ("published as v2x.", "published"),
            ("as raw.", "raw"),
        )
    )
    return f"users: {counts}{_slow(endpoint)}"


def _reports(status: Mapping[str, object]) -> list[Table]:
    """Return a line only if a subscriber of port 5558 is slow."""
    slow = _slow(within(status, "report"))
    return [Table(f"reports{slow}")] if slow else []


def _slow(publisher: Mapping[str, object]) -> str:
    since = number(publisher, "slow_since")
    if since <= 0:
        return ""
    clock = time.strftime("%H:%M:%S", time.localtime(min(since, LAST_TIME)))
    return f"; a subscriber is slow since {clock}, time {number(publisher, 'slow_count'):.0f}"


def _drops(status: Mapping[str, object], now: float) -> Table:
    found = sorted(listed(status, "drops"), key=lambda drop: -number(drop, "count"))
    rows = [
        (
            text(drop, "where"),
            text(drop, "reason"),
            f"{number(drop, 'count'):.0f}",
            span(max(0.0, now - number(drop, "time"))),
            f"{number(drop, 'octets'):.0f}",
            text(drop, "sample"),
        )
        for drop in found
    ]
    notes = _meanings(found)
    notes += [
        f"{text(drop, 'where')}, the last {text(drop, 'reason')}: {text(drop, 'detail')}"
        for drop in found
        if text(drop, "detail")
    ]
    heads = ("where", "reason", ">count", ">ago", ">octets", "last sample")
    return Table("drops" if rows else "no drops", heads, rows, notes)


def _meanings(counts: Sequence[Mapping[str, object]]) -> list[str]:
    """Return the meaning of each reason once."""
    meanings = {text(one, "reason"): text(one, "meaning") for one in counts}
    return [f"{reason}: {meaning}" for reason, meaning in meanings.items()]


def _implausible(status: Mapping[str, object], now: float) -> list[Table]:
    """Return a table only if messages were marked as implausible. Dropped ones are in the table of drops."""
    found = [(name, doubt) for name, one in named(status, "interfaces") for doubt in listed(one, "implausible")]
    rows = [
        (
            name,
            text(doubt, "reason"),
            f"{number(doubt, 'count'):.0f}",
            span(max(0.0, now - number(doubt, "time"))),
            text(doubt, "source"),
        )
        for name, doubt in found
    ]
    notes = _meanings([doubt for _, doubt in found])
    heads = ("interface", "reason", ">count", ">ago", "last source")
    return [Table("implausible messages", heads, rows, notes)] if rows else []


def _duplicates(status: Mapping[str, object]) -> Table:
    duplicates = within(status, "duplicates")
    window = number(duplicates, "window_s")
    if not window:
        return Table("duplicate suppression is off")
    first, lead = within(duplicates, "first"), within(duplicates, "lead_ms")
    rows = [(name, f"{number(first, name):.0f}", f"{number(lead, name):.1f}") for name in sorted({*first, *lead})]
    suppressed = number(duplicates, "suppressed")
    title = f"duplicates within {window:g} s: {suppressed:.0f} suppressed"
    return Table(title, ("interface", ">first", ">lead ms"), rows if suppressed else ())


def _paths(status: Mapping[str, object]) -> list[Table]:
    """Return a table only if messages arrive by more than one interface."""
    duplicates = within(status, "duplicates")
    found = listed(duplicates, "paths")
    rows = [row for path in found for row in _path(path)]
    if not rows:
        return []
    kept, forgotten = number(duplicates, "paths_kept"), number(duplicates, "paths_forgotten")
    more = f"the last {len(found)} of {kept:.0f} that are kept; {forgotten:.0f} forgotten"
    notes = [more] if kept > len(found) else []
    heads = ("station", "type", "interface", ">first", ">lead ms", ">alone")
    return [Table("which interface was first, and messages of one interface alone", heads, rows, notes)]


def _path(path: Mapping[str, object]) -> list[tuple[str, ...]]:
    """Return a row for each interface; only the first one has station and type."""
    first, lead, alone = (within(path, key) for key in ("first", "lead_ms", "alone"))
    rows: list[tuple[str, ...]] = []
    who = f"{number(path, 'station'):.0f}", text(path, "type") or "(no name)"
    for name in sorted({*first, *alone}):
        led = f"{number(lead, name):.1f}" if name in lead else ""
        rows.append((*who, name, f"{number(first, name):.0f}", led, f"{number(alone, name):.0f}"))
        who = "", ""
    return rows


def _policy(status: Mapping[str, object]) -> Table:
    rows = [
        (text(row, "name") or f"row {index}", f"{number(row, 'matched'):.0f}")
        for index, row in enumerate(listed(status, "policy"))
    ]
    return Table("policy" if rows else "no policy", ("row", ">matched"), rows)
