"""Time section of a status as tables; missing or malformed values are omitted."""

import time
from collections.abc import Iterator, Mapping

from board.time.scales import EPOCH
from firmware.client.show.table import Table, span, times
from firmware.untrusted import listed, number, text, within

REASONS = 2  # refusal reasons listed in full, so that the table fits on a terminal of 24 lines
LAST_TIME = 253402300799.0  # 9999-12-31, the last date that datetime supports

WORDS = {
    "locked": "set by pulses",
    "settling": "first pulses received, a few more are needed",
    "holdover": "no good pulse recently: the oscillator continues",
    "coarse": "set by messages of a receiver",
    "system": "the system's clock alone",
    "unknown": "no source",
}


def title(clock: Mapping[str, object]) -> str:
    """Return the state of the time as one line, with its uncertainty."""
    state = text(clock, "state") or "unknown"
    bound = f", within {duration(number(clock, 'uncertainty_ns'))}" if clock.get("uncertainty_ns") is not None else ""
    return f"time {state}: {WORDS.get(state, 'a state of another version')}{bound}"


def table(clock: Mapping[str, object]) -> Table:
    """Return the table of the station's time; rows without a value are omitted."""
    rows = [
        ("ITS time", _its(clock)),
        ("system clock", _system(clock)),
        ("oscillator", _oscillator(clock)),
        ("leap seconds", _leap(within(clock, "leap"))),
        ("", _event(within(within(clock, "leap"), "event"))),
        ("receiver", text(clock, "receiver")),
        ("pulses", _pulses(within(clock, "pulse"))),
        ("", _counted(within(clock, "pulse"))),
        ("chronyd", _fed(within(clock, "refclock"))),
        ("", _tracked(within(clock, "tracking"))),
    ]
    return Table(title(clock), ("what", "value"), [row for row in rows if row[1]], list(_notes(clock)))


def duration(ns: float) -> str:
    """Return a duration with three significant figures: 412 ns, 5.21 us, 1.2 ms, 3.7 s."""
    for factor, unit in ((1e9, "s"), (1e6, "ms"), (1e3, "us")):
        if abs(ns) >= factor * 0.9995:
            return f"{ns / factor:.3g} {unit}" if abs(ns) < 1000 * factor else f"{ns / factor:.0f} {unit}"
    return f"{ns:.0f} ns"


def _its(clock: Mapping[str, object]) -> str:
    if clock.get("its_ms") is None:
        return ""
    its_ms, leap = number(clock, "its_ms"), within(clock, "leap")
    if leap.get("seconds") is None:
        return f"{its_ms:.0f} ms"
    unix_s = min(max(0.0, its_ms // 1000 - number(leap, "seconds") + EPOCH), LAST_TIME)
    return f"{its_ms:.0f} ms, {time.strftime('%Y-%m-%d %H:%M:%S UTC', time.gmtime(unix_s))}"


def _system(clock: Mapping[str, object]) -> str:
    if clock.get("offset_ns") is None:
        return "its error is unknown" if text(clock, "state") == "system" else ""
    offset_ns = number(clock, "offset_ns")
    way = "behind" if offset_ns >= 0 else "ahead"
    return f"{duration(abs(offset_ns))} {way}; time stamps are within {duration(number(clock, 'error_ns'))}"


def _oscillator(clock: Mapping[str, object]) -> str:
    if clock.get("frequency_ppb") is None:
        return ""
    ppb = number(clock, "frequency_ppb")
    way = "fast" if ppb >= 0 else "slow"
    return f"runs {abs(ppb) / 1000:.4f} ppm {way}, +-{number(clock, 'skew_ppb') / 1000:.4f} ppm"


def _leap(leap: Mapping[str, object]) -> str:
    if not leap:
        return ""
    expires = "" if leap.get("expires") is None else f" until {_day(number(leap, 'expires'))}"
    by = {"receiver": "the receiver", "built in": "the built-in table"}
    table = text(leap, "table")
    counted = "not known" if leap.get("seconds") is None else f"{number(leap, 'seconds'):.0f}"
    return f"{counted} since 2004 by {by.get(table, table.rpartition('/')[2])}{expires}"


def _event(event: Mapping[str, object]) -> str:
    return f"announced: {number(event, 'change'):+.0f} at {text(event, 'utc')}" if event else ""


def _day(unix_s: float) -> str:
    return time.strftime("%Y-%m-%d", time.gmtime(min(max(0.0, unix_s), LAST_TIME)))


def _pulses(pulse: Mapping[str, object]) -> str:
    if not pulse:
        return ""
    if pulse.get("is_open") is not True:
        return f"{text(pulse, 'input')}: not open"
    ago = "none yet" if pulse.get("age_s") is None else f"the last {span(max(0.0, number(pulse, 'age_s')))} ago"
    return f"{text(pulse, 'input')}, {ago}"


def _counted(pulse: Mapping[str, object]) -> str:
    counts = (("taken", "taken"), ("good", "seconds"), ("missed", "missed"), ("too many", "extra"), ("late", "late"))
    told = [f"{number(pulse, key):.0f} {word}" for word, key in counts if key in pulse]
    refused = sum(number(one, "count") for one in listed(pulse, "refused"))
    return ", ".join([*told, *([f"{refused:.0f} refused"] if refused else [])])


def _fed(refclock: Mapping[str, object]) -> str:
    if not refclock:
        return ""
    samples = within(refclock, "samples")
    others = ", ".join(f"{number(samples, fate):.0f} {fate}" for fate in samples if fate != "sent")
    state = "is fed" if refclock.get("feeds") is True else "is not fed"
    return f"{state}: {number(samples, 'sent'):.0f} samples sent" + (f", {others}" if others else "")


def _tracked(tracking: Mapping[str, object]) -> str:
    if "stratum" not in tracking:
        return ""
    offset_ns = number(tracking, "system_offset_s") * 1e9
    return (
        f"stratum {number(tracking, 'stratum'):.0f} by {text(tracking, 'reference') or 'nobody'}, "
        f"offset {duration(offset_ns)}, {number(tracking, 'frequency_ppm'):.3f} ppm, leap {text(tracking, 'leap')}"
    )


def _notes(clock: Mapping[str, object]) -> Iterator[str]:
    """Yield problems with their remedies, then the reasons of refused pulses, the most frequent first."""
    pulse, refclock, tracking = (within(clock, key) for key in ("pulse", "refclock", "tracking"))
    if text(clock, "missing"):
        yield text(clock, "missing")
    if text(pulse, "why"):
        hint = f" ({text(pulse, 'hint')})" if text(pulse, "hint") else ""
        yield f"no pulses: {text(pulse, 'why')}{hint}"
    if text(refclock, "why"):
        yield f"chronyd is not fed: {text(refclock, 'why')}"
    if text(tracking, "why"):
        yield f"nothing is known of chronyd: {text(tracking, 'why')}"
    if text(within(clock, "leap"), "doubt"):
        yield text(within(clock, "leap"), "doubt")
    # The reason "acquiring" occurs at each start: it is not a fault.
    refused = [one for one in listed(pulse, "refused") if text(one, "reason") != "acquiring"]
    if number(pulse, "surprises"):
        how_often = times(number(pulse, "surprises"))
        yield f"{how_often} pulses came back and the time was further off than had been stated"
    refused.sort(key=lambda one: -number(one, "count"))
    for one in refused[:REASONS]:
        detail = f"; the last: {text(one, 'detail')}" if text(one, "detail") else ""
        yield f"refused {times(number(one, 'count'))}, {text(one, 'reason')}: {text(one, 'meaning')}{detail}"
    if others := refused[REASONS:]:
        how_often = times(sum(number(one, "count") for one in others))
        yield f"refused {how_often} for others: {', '.join(text(one, 'reason') for one in others)}"
