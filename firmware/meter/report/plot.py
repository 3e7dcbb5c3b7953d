"""Plots of a result as numbers, for the page's script and for SVG."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

Object = Mapping[str, Any]
COLOURS = ("#1f5fa8", "#d1702b", "#2f8f5b", "#8b4fb0", "#b03a5b", "#6b6f1d", "#3a8fa8", "#7a5a3a")


class Series(NamedTuple):
    """One curve.

    values  a value for each place on the horizontal axis; None for an unknown one.
    points  mark each value.
    """

    name: str
    colour: str
    values: list[float | None]
    points: bool = False


class Plot(NamedTuple):
    """Curves or bars over one horizontal axis.

    at         places on the horizontal axis.
    bars       draw bars instead of curves.
    from_zero  let the vertical axis begin at 0.
    """

    key: str
    title: str
    x: str
    y: str
    unit: str
    at: list[float]
    series: list[Series]
    bars: bool = False
    from_zero: bool = True


def plots(result: Object) -> Iterator[Plot]:
    """Yield the plots that have at least one value."""
    lines = (
        ("loss", "Loss, by intervals T", "loss, %", "%", _loss),
        ("delay", "One-way delay, mean by intervals T", "delay, ms", "ms", _delay),
        ("longest", "One-way delay, longest by intervals T", "delay, ms", "ms", _longest),
        ("gap", "Longest gap between receptions, by intervals T", "gap, s", "s", _gap),
        ("rssi", "Signal strength, mean by intervals T", "RSSI, dBm", "dBm", _rssi),
    )
    for key, title, label, unit, value in lines:
        at, series = _over_time(result, value)
        if any(one is not None for line in series for one in line.values):
            yield Plot(key, title, "seconds from the beginning", label, unit, at, series, from_zero=unit != "dBm")
    yield from _distributions(result)
    clocks = _clocks(result)
    if clocks is not None:
        yield clocks


def _over_time(result: Object, value: Any) -> tuple[list[float], list[Series]]:
    """Return a common time axis, and the values of each direction by interval on it."""
    begun = sorted({window["at_s"] for way in result["ways"] for window in way["windows"]})
    if not begun:
        return [], []
    series = []
    for way, colour in zip(result["ways"], _colours(), strict=False):
        known = {window["at_s"]: value(window) for window in way["windows"]}
        series.append(Series(way["way"], colour, [known.get(at_s) for at_s in begun], len(begun) < 60))
    return [round(at_s - begun[0], 3) for at_s in begun], series


def _loss(window: Object) -> float | None:
    known = window["sent"] - window["unseen"]
    return round(100 * window["lost"] / known, 3) if known > 0 else None


def _delay(window: Object) -> float | None:
    return None if window["delay_us"] is None else window["delay_us"] / 1000


def _longest(window: Object) -> float | None:
    return None if window["delay_longest_us"] is None else window["delay_longest_us"] / 1000


def _gap(window: Object) -> float | None:
    found: float | None = window["gap_longest_s"]
    return found


def _rssi(window: Object) -> float | None:
    found: float | None = window["rssi_dbm"]
    return found


def _distributions(result: Object) -> Iterator[Plot]:
    """Yield histograms of one-way delays and gaps for each direction, then their cumulative distributions."""
    kinds = (
        ("delays", "One-way delay", "delay, ms", 1000.0),
        ("gaps", "Gap between receptions", "gap, s", 1.0),
    )
    for key, title, label, divisor in kinds:
        told = [
            (way["way"], colour, way[key])
            for way, colour in zip(result["ways"], _colours(), strict=False)
            if way[key] is not None
        ]
        if not told:
            continue
        for name, colour, one in told:
            at = [(one["low"] + place * one["width"]) / divisor for place in range(len(one["bars"]))]
            more = f"; {one['above']} longer ones are not shown" if one["above"] else ""
            title_of = f"{title}: distribution, {name}{more}"
            yield Plot(f"{key} {name}", title_of, label, "messages", "", at, [Series(name, colour, one["bars"])], True)
        # The largest value is omitted, because it would stretch the axis.
        at = sorted({value / divisor for _, _, one in told for value in one["cumulative"][:-1]})
        series = [Series(name, colour, _shares(one["cumulative"], divisor, at)) for name, colour, one in told]
        yield Plot(f"{key} cumulative", f"{title}: share up to this value", label, "share, %", "%", at, series)


def _shares(cumulative: Sequence[float], divisor: float, at: Sequence[float]) -> list[float | None]:
    """Return the shares in percent of the values that do not exceed each place of an axis."""
    last, place = len(cumulative) - 1, 0
    shares: list[float | None] = []
    for value in at:
        while place <= last and cumulative[place] / divisor <= value:
            place += 1
        shares.append(round(100 * max(0, place - 1) / last, 2) if place else 0.0)
    return shares


def _clocks(result: Object) -> Plot | None:
    """Return the plot of each station's clock uncertainty; None if all are unknown."""
    told = [
        (name, one["clock"])
        for name, one in result["stations"].items()
        if any(second["uncertainty_ns"] is not None for second in one["clock"])
    ]
    if not told:
        return None
    began_s = result["began_s"]
    at = sorted({round(second["at_s"] - began_s, 2) for _, clock in told for second in clock})
    series = []
    for (name, clock), colour in zip(told, _colours(), strict=False):
        known = {
            round(second["at_s"] - began_s, 2): second["uncertainty_ns"] / 1e6
            for second in clock
            if second["uncertainty_ns"] is not None
        }
        series.append(Series(name, colour, [known.get(one) for one in at], True))
    title = "Clock quality: stated bound of the error"
    return Plot("clocks", title, "seconds from the beginning", "uncertainty, ms", "ms", at, series)


def _colours() -> Iterator[str]:
    while True:
        yield from COLOURS
