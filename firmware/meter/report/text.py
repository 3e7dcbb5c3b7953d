"""Tables of a result, 80 columns wide, for terminals and serial consoles."""

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from firmware.client.show.table import Table

Object = Mapping[str, Any]


def tables(result: Object) -> Iterator[Table]:
    """Yield the tables that have at least one row."""
    if result["ways"]:
        yield losses(result)
        yield delays(result)
        yield freshness(result)
    if len(result["rows"]) > len(result["ways"]):
        yield rows(result)
    if result["paths"]:
        yield paths(result)
    if result["trips"]:
        yield trips(result)
    if result["leaving"]:
        yield hops(result)
    if not result["ways"] and result["hearing"]:
        yield hearing(result)
    yield stations(result)


def losses(result: Object) -> Table:
    """Return tables 1 and 3 of the paper: sent, arrived and lost messages of each direction."""
    heads = ("way", ">sent", ">arrived", ">lost", ">loss", ">late", ">twice", ">order", ">unseen")
    keys = ("sent", "arrived", "lost")
    cells = [
        (one["way"], *(str(one[key]) for key in keys), share(one["loss"]), *(str(one[key]) for key in REST))
        for one in result["ways"]
    ]
    title = f"{result['title']}: {result['duration_s']:.1f} s from {result['began']}"
    return Table(title, heads, cells, list(result["notes"]))


REST = ("late", "duplicates", "reordered", "unseen")


def rows(result: Object) -> Table:
    """Return the losses and delays by type and station."""
    heads = ("way", "type", ">station", ">sent", ">arrived", ">lost", ">loss", ">delay", ">longest gap")
    cells = [
        (
            one["way"],
            one["type"] or "(no name)",
            "-" if one["station_id"] is None else str(one["station_id"]),
            *(str(one[key]) for key in ("sent", "arrived", "lost")),
            share(one["loss"]),
            duration(one["one_way_us"], "median"),
            duration(one["gap_s"], "most", 1e6),
        )
        for one in result["rows"]
    ]
    return Table("By type and station", heads, cells)


def delays(result: Object) -> Table:
    """Return the delays from acceptance by one station to reception by the other, with their parts."""
    heads = ("way", ">median", ">p95", ">longest", ">+-", ">queue", ">send", ">link", ">+-")
    cells = [
        (
            one["way"],
            *(duration(one["one_way_us"], key) for key in ("median", "p95", "most")),
            *(
                duration(one[key], "median")
                for key in ("one_way_doubt_us", "queue_us", "send_us", "link_us", "doubt_us")
            ),
        )
        for one in result["ways"]
    ]
    notes = ["delay: from accepted by one station to received by the other; link: the part between; +-: accuracy"]
    if any(one["is_round_trip"] for one in result["ways"]):
        notes.append("a way from a station to itself is a round trip, with the time at the reflecting end")
    return Table("Delay", heads, cells, notes)


def freshness(result: Object) -> Table:
    heads = ("way", ">gap mean", ">p95", ">longest", ">age mean", ">p95 peak", ">longest", ">RSSI dBm")
    cells = [
        (
            one["way"],
            *(duration(one["gap_s"], key, 1e6) for key in ("mean", "p95", "most")),
            duration(one["age_s"], "mean", 1e6),
            *(duration(one["age_s"]["peak"], key, 1e6) for key in ("p95", "most")),
            number(one["rssi_dbm"], "median"),
        )
        for one in result["ways"]
    ]
    return Table("Gap between receptions, and age of information", heads, cells)


def paths(result: Object) -> Table:
    heads = ("way", ">sent", ">arrived", ">delivered", ">first", ">lead", ">alone", ">median")
    cells = []
    for both in result["paths"]:
        for one in both["ways"]:
            cells.append(
                (
                    one["way"],
                    *(str(one[key]) for key in ("sent", "arrived")),
                    share(one["delivery"]),
                    str(one["first"]),
                    duration(one["lead_us"], "median"),
                    str(one["alone"]),
                    duration(one["one_way_us"], "median"),
                )
            )
        cells.append(
            (
                f"{both['sender']} > {both['receiver']} all together",
                str(both["sent"]),
                str(both["arrived"]),
                share(both["delivery"]),
                "",
                "",
                "",
                duration(both["one_way_us"], "median"),
            )
        )
    notes = [
        f"{both['sender']} > {both['receiver']}: all interfaces deliver {share(both['gain'])} more than the best one"
        for both in result["paths"]
        if both["gain"] is not None
    ]
    return Table("Messages sent by several interfaces: which was first, by how much", heads, cells, notes)


def trips(result: Object) -> Table:
    heads = ("probes from user to user", ">count", ">median", ">p95", ">longest")
    cells = [
        (
            f"{one['sender']} > {one['receiver']}",
            number(one["user_us"], "count", 0),
            *(duration(one["user_us"], key) for key in ("median", "p95", "most")),
        )
        for one in result["trips"]
    ]
    return Table("From ZeroMQ to ZeroMQ, by the clock of this meter", heads, cells)


def hops(result: Object) -> Table:
    """Return the times inside each station: queue, sending, delivery to users."""
    heads = ("station", "hop", ">count", ">median", ">p95", ">longest")
    cells = []
    for one in result["leaving"]:
        for name, key in (("queue", "queue_us"), ("send", "send_us")):
            cells.append((one["station"], f"{one['interface']}: {name}", *_spread(one[key])))
    cells += [(one["station"], "up: to users", *_spread(one["up_us"])) for one in result["delivered"] if one["up_us"]]
    notes = [
        f"{one['station']}: {count} messages not sent by {one['interface'] or 'the station'}: {reason}"
        for one in result["leaving"]
        for reason, count in one["not_sent"].items()
    ]
    return Table("Delays inside the stations, by step", heads, cells, notes)


def hearing(result: Object) -> Table:
    heads = ("station", "interface", "type", ">of station", ">received", ">gap mean", ">p95", ">longest", ">RSSI dBm")
    cells = [
        (
            one["station"],
            one["interface"],
            one["type"] or "(no name)",
            "-" if one["station_id"] is None else str(one["station_id"]),
            str(one["received"]),
            *(duration(one["gap_s"], key, 1e6) for key in ("mean", "p95", "most")),
            number(one["rssi_dbm"], "median"),
        )
        for one in result["hearing"]
    ]
    return Table("Heard", heads, cells)


def stations(result: Object) -> Table:
    heads = ("station", "where", "version", "time", ">+-", "configuration")
    cells = [
        (
            name,
            str(one.get("where", "")),
            str(one.get("version", "")),
            str(one.get("time", "")),
            duration({"now": one.get("uncertainty_us")}, "now"),
            str(one.get("configuration", ""))[:12],
        )
        for name, one in result["stations"].items()
    ]
    notes = [f"{name}: {note}" for name, one in result["stations"].items() for note in one.get("notes", ())]
    return Table("Stations", heads, cells, notes)


def share(value: float | None) -> str:
    return "-" if value is None else f"{100 * value:.2f} %"


def duration(measure: Object | None, key: str, factor: float = 1.0) -> str:
    """Return a duration of a measure in a readable unit; factor converts the measure to microseconds."""
    if measure is None or measure.get(key) is None:
        return "-"
    return of_us(measure[key] * factor)


def of_us(us: float) -> str:
    size = abs(us)
    if size < 1000:
        return f"{us:.0f} us"
    return f"{us / 1000:.2f} ms" if size < 100_000 else f"{us / 1e6:.3f} s"


def number(measure: Object | None, key: str, digits: int = 1) -> str:
    return "-" if measure is None or measure.get(key) is None else f"{measure[key]:.{digits}f}"


def _spread(measure: Object | None) -> Iterable[str]:
    return (number(measure, "count", 0), *(duration(measure, key) for key in ("median", "p95", "most")))
