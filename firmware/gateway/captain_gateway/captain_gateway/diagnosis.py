"""Statuses for /diagnostics: of the station and of each handler."""

from collections.abc import Mapping
from typing import NamedTuple

from .counts import Counts

OK, WARN, ERROR = 0, 1, 2  # diagnostic_msgs/DiagnosticStatus


class Status(NamedTuple):
    """One DiagnosticStatus; values become KeyValue."""

    level: int
    name: str
    message: str
    values: dict[str, str]


def of_station(
    where: str, is_there: bool | None, told: Mapping[str, object], rubbish: int, sample: bytes, more: Mapping[str, str]
) -> Status:
    """Return the status of the station at the address `where`.

    is_there  its heartbeat was received within 3 s; None until it was first received or missed.
    told      its last status report; empty before the first.
    rubbish   number of unreadable messages; `sample`: start of the last one.
    more      further values to show.
    """
    values = {"address": where, "rubbish": str(rubbish)} | dict(more)
    if rubbish:
        values["last rubbish"] = sample.hex()
    if not is_there:
        words = "no station is heard" if is_there is None else "the station is silent: no heartbeat for 3 s"
        return Status(ERROR, "station", f"{words} at {where}", values)
    for name in ("station", "version", "uptime_s"):
        if name in told:
            values[name] = str(told[name])
    complaints = [
        f"{name} is {interface.get('state')}: {interface.get('why')}"
        for name, interface in _table(told.get("interfaces")).items()
        if isinstance(interface, dict) and interface.get("state") != "up"
    ]
    return Status(WARN if complaints else OK, "station", "; ".join(complaints) or "connected", values)


def of_handler(name: str, counts: Counts, since: Counts, strangers: list[str], active: tuple[bool, bool]) -> Status:
    """Return the status of a handler.

    It is a warning if messages were refused or undecodable since the last status, or if other nodes have problems.

    since      counters at the last status.
    strangers  problems of other nodes on its topics.
    active     parameters receive.active and transmit.active.
    """
    values = {
        "receive": "active" if active[0] else "inactive",
        "transmit": "active" if active[1] else "inactive",
        "received": str(counts.received),
        "published": str(counts.published),
        "with parts left out": str(counts.left_out),
        "ambiguous edition": str(counts.doubtful),
        "taken": str(counts.taken),
        "sent": str(counts.sent),
    }
    for title, counter in (
        ("not published", counts.not_published),
        ("not sent", counts.not_sent),
        ("outcome", counts.outcomes),
    ):
        values |= {f"{title}: {cause}": str(count) for cause, count in sorted(counter.items())}
    whys = {
        "last not published": counts.why_not_published,
        "last not sent": counts.why_not_sent,
        "last refused": counts.why_refused,
    }
    values |= {key: why for key, why in whys.items() if why}
    fresh = []
    if counts.not_published["undecodable"] > since.not_published["undecodable"]:
        fresh.append(f"not published: {counts.why_not_published}")
    if _wrong(counts) > _wrong(since):
        fresh.append(f"not sent: {counts.why_not_sent}")
    if counts.outcomes["refused"] + counts.outcomes["dropped"] > since.outcomes["refused"] + since.outcomes["dropped"]:
        fresh.append(counts.why_refused)
    fresh += strangers
    return Status(WARN if fresh else OK, name, "; ".join(fresh) or "ok", values)


def _wrong(counts: Counts) -> int:
    """Return the number of unsent messages, without those that settings or newer messages excluded on purpose."""
    return sum(count for cause, count in counts.not_sent.items() if cause not in ("inactive", "replaced"))


def _table(value: object) -> dict[str, object]:
    return value if isinstance(value, dict) else {}
