"""Result of a measurement as a JSON object, for `--json` and reports."""

import math
import time
from bisect import bisect_right
from collections.abc import Iterator, Mapping
from typing import NamedTuple

from firmware import VERSION
from firmware.meter.fate import Fate, Way
from firmware.meter.figures import OTHERS, Figures, Key
from firmware.meter.inside import Inside
from firmware.meter.meter import Meter
from firmware.meter.paths import Paths
from firmware.meter.prober import Prober
from firmware.meter.report.spots import Spot
from firmware.meter.sample import MOST, Sample

GLANCE = 1024  # numbers of each measure from which quantiles for a live screen are computed
BARS = 60  # bars of a distribution
STEPS = 200  # steps of a cumulative distribution


class About(NamedTuple):
    """Description of a measurement.

    title, what  title of the report, and source of the figures as text.
    began_s      start as Unix time.
    for_s        duration in seconds.
    stations     by name: address, version, configuration, clock, seconds of its quality, missed reports.
    notes        notes for the reader of the figures.
    """

    title: str
    what: str
    began_s: float
    for_s: float
    stations: Mapping[str, Mapping[str, object]]
    notes: tuple[str, ...] = ()


def result(meter: Meter, about: About, prober: Prober | None = None, is_glance: bool = False) -> dict[str, object]:
    """Return the result as an object for JSON. Times are in microseconds, gaps and ages in seconds; null means unknown.

    is_glance  return only the part for a live screen: quantiles of fewer numbers, no time lines and no map.
    """
    return {
        "captain": VERSION,
        "title": about.title,
        "what": about.what,
        "began": time.strftime("%Y-%m-%d %H:%M:%S UTC", time.gmtime(about.began_s)),
        "began_s": round(about.began_s, 3),
        "duration_s": round(about.for_s, 3),
        "interval_s": meter.interval_s,
        "grace_s": meter.grace_s,
        "stations": dict(about.stations),
        "ways": [_way(way, meter, is_glance) for way in _used(meter)],
        "rows": [_row(key, one, is_glance) for key, one in meter.rows],
        "paths": list(_paths(meter.paths)),
        **_inside(meter.inside),
        "trips": _trips(prober) if prober is not None else [],
        "map": [] if is_glance else [_spot(spot) for spot in sorted(meter.spots, key=lambda spot: spot.at_s)],
        "map_more": meter.spots.more,
        "notes": [*about.notes, *_notes(meter)],
    }


def figures(one: Figures, is_glance: bool = False) -> dict[str, object]:
    """Return counts and measures of one direction or row."""
    counts = one.counts

    def measure(sample: Sample, digits: int = 1) -> dict[str, object] | None:
        return measured(sample, digits, GLANCE if is_glance else MOST)

    return {
        "sent": one.sent,
        "arrived": one.arrived,
        "lost": one.lost,
        "late": counts[Fate.LATE],
        "unseen": counts[Fate.UNSEEN],
        "duplicates": counts[Fate.DUPLICATE],
        "reordered": one.reordered,
        "repeats": one.repeats,
        "loss": _rounded(one.loss, 6),
        "octets": one.octets,
        "one_way_us": measure(one.one_way_us),
        "link_us": measure(one.link_us),
        "one_way_doubt_us": measure(one.one_way_doubt_us),
        "doubt_us": measure(one.doubt_us),
        "queue_us": measure(one.queue_us),
        "send_us": measure(one.send_us),
        "gap_s": _with_open(measure(one.gaps.gaps, 6), one.open_s),
        "age_s": {
            "mean": _rounded(one.age.mean_s(one.open_s), 6),
            "peak": _with_open(measure(one.age.peaks, 6), one.open_s, one.age.last_s or 0.0),
        },
        "rssi_dbm": measure(one.rssi_dbm),
    }


def _with_open(told: dict[str, object] | None, open_s: float, before_s: float = 0.0) -> dict[str, object] | None:
    """Return a measure of gaps or ages extended by an open gap at the end: its largest value is at least that."""
    if told is None:
        return None
    most = told["most"]
    assert isinstance(most, float | int)
    return told | {"open": round(open_s, 6), "most": round(max(most, open_s + before_s), 6)} if open_s else told


def measured(sample: Sample, digits: int = 1, most: int = MOST) -> dict[str, object] | None:
    """Return mean, extremes and quantiles of a sample; None if it is empty.

    most  limit of numbers from which quantiles are computed.
    """
    if not sample.count:
        return None
    median, p95, p99 = sample.quantiles(0.5, 0.95, 0.99, most=most)
    told = {"mean": sample.mean, "least": sample.least, "median": median, "p95": p95, "p99": p99, "most": sample.most}
    return {"count": sample.count, **{key: _rounded(value, digits) for key, value in told.items()}}


def distribution(sample: Sample) -> dict[str, object] | None:
    """Return a histogram of BARS equal bars, and the cumulative distribution in STEPS steps; None for an empty sample.

    The bars cover values up to the 99.5th percentile; `above` counts the others. Counts are scaled to all values of the
    sample, although not all are kept.
    """
    values = sorted(sample.values())
    if not values:
        return None
    low, high = values[0], values[math.ceil(0.995 * len(values)) - 1]
    inside = bisect_right(values, high)
    width = (high - low) / BARS or max(abs(high), 1.0) / BARS
    each = sample.count / len(values)
    bars = [0] * BARS
    for value in values[:inside]:
        bars[min(BARS - 1, int((value - low) / width))] += 1
    shares = [step / STEPS for step in range(STEPS + 1)]
    at = [values[min(len(values) - 1, int(share * len(values)))] for share in shares]
    return {
        "low": _significant(low),
        "width": _significant(width),
        "bars": [round(bar * each) for bar in bars],
        "above": round((len(values) - inside) * each),
        "cumulative": [_significant(value) for value in at],
    }


def _significant(value: float) -> float:
    return float(f"{value:.6g}")


def _used(meter: Meter) -> list[Way]:
    return sorted(way for way, one in meter.ways.items() if one.whole.sent)


def _named(way: Way) -> dict[str, object]:
    return {"way": str(way), **way._asdict(), "is_round_trip": way.is_round_trip}


def _row(key: Key, one: Figures, is_glance: bool) -> dict[str, object]:
    told = {**_named(key.way), "type": key.type, "station_id": key.station_id, **figures(one, is_glance)}
    # Gaps between messages of several sources have no meaning.
    return told | {"gap_s": None, "age_s": {"mean": None, "peak": None}} if key.type == OTHERS else told


def _way(way: Way, meter: Meter, is_glance: bool) -> dict[str, object]:
    one = meter.ways[way]
    told = {**_named(way), **figures(one.whole, is_glance), "strange": one.whole.counts[Fate.STRANGE]}
    if is_glance:
        return told
    return told | {
        "delays": distribution(one.whole.one_way_us),
        "gaps": distribution(one.whole.gaps.gaps),
        "windows": [{"at_s": round(begun, 3), **window.as_json()} for begun, window in one.windows],
        "windows_forgotten": one.windows.forgotten,
    }


def _paths(paths: Paths) -> Iterator[dict[str, object]]:
    for between, both in sorted(paths.both.items()):
        yield {
            **between._asdict(),
            "sent": both.sent,
            "arrived": both.arrived,
            "delivery": _rounded(both.delivery, 6),
            "gain": _rounded(both.gain, 6),
            "one_way_us": measured(both.one_way_us),
            "ways": [
                {
                    **_named(way),
                    "sent": one.sent,
                    "arrived": one.arrived,
                    "delivery": _rounded(one.delivery, 6),
                    "first": one.first,
                    "alone": one.alone,
                    "lead_us": measured(one.lead_us),
                    "one_way_us": measured(one.one_way_us),
                }
                for way, one in sorted(both.ways.items())
            ],
        }


def _inside(inside: Inside) -> dict[str, object]:
    return {
        "leaving": [
            {
                **port._asdict(),
                "sent": one.sent,
                "queue_us": measured(one.queue_us),
                "send_us": measured(one.send_us),
                "not_sent": dict(one.not_sent),
            }
            for port, one in sorted(inside.leaving.items())
        ],
        "hearing": [
            {
                **source._asdict(),
                "received": one.received,
                "gap_s": measured(one.gaps.gaps, 6),
                "rssi_dbm": measured(one.rssi_dbm),
            }
            for source, one in inside.hearing()
        ],
        "delivered": [
            {"station": station, "types": dict(one.types), "up_us": measured(one.up_us)}
            for station, one in sorted(inside.delivered.items())
        ],
    }


def _trips(prober: Prober) -> list[dict[str, object]]:
    return [{**trip._asdict(), "user_us": measured(sample)} for trip, sample in sorted(prober.trips_us.items())]


def _spot(spot: Spot) -> dict[str, object]:
    return {
        "at_s": round(spot.at_s, 3),
        "way": str(spot.way),
        "station_id": spot.station_id,
        "type": spot.type,
        "is_lost": spot.is_lost,
        "rssi_dbm": spot.rssi_dbm,
        "sender": [round(degrees, 7) for degrees in spot.sender],
        "receiver": None if spot.receiver is None else [round(degrees, 7) for degrees in spot.receiver],
        "is_guessed": spot.is_guessed,
    }


def _notes(meter: Meter) -> Iterator[str]:
    wholes = [one.whole for one in meter.ways.values()]
    ways = [way for way in meter.ways if not way.is_round_trip]
    if len(meter.stations) > 1 and not ways:
        yield "The stations have no common interface; name two that hear each other: --between A:g5=B:air."
    elif not any(one.sent for one in wholes):
        yield "No message left a measured station."
    repeats = sum(one.repeats for one in wholes)
    if sum(one.arrived for one in wholes) > sum(one.one_way_us.count for one in wholes) + repeats:
        yield (
            "Some messages have no one-way delay: the accuracy of the clocks is unknown. A round trip needs one clock "
            "only: --probe with --round-trip, and --reflect at the other end."
        )
    if repeats:
        yield (
            f"{repeats} messages have no delay: several copies of the same octets may have been under way at a time. "
            "They are counted."
        )
    if strange := sum(one.counts[Fate.STRANGE] for one in wholes):
        yield f"{strange} messages came from other senders, or from before or after the measurement."


def _rounded(value: float | None, digits: int) -> float | None:
    return None if value is None or not math.isfinite(value) else round(value, digits)
