"""Plots and maps as SVG, for print and for pages without scripts."""

import math
from collections.abc import Iterator, Mapping, Sequence
from html import escape
from typing import Any

from firmware.meter.report.plot import Plot, Series

WIDTH, HEIGHT = 640, 280
LEFT, RIGHT, TOP, BOTTOM = 58, 10, 8, 36
DOTS = 600  # points of a curve; more are not visible at this width
METRES = 111_320.0  # metres per degree of latitude
# Colours of signal strengths up to a limit in dBm: viridis, reversed, which the colour-blind can distinguish and which
# prints in grey.
STRENGTHS = ((-95.0, "#fde725"), (-85.0, "#7ad151"), (-75.0, "#22a884"), (-65.0, "#2a788e"), (-55.0, "#414487"))
LOST, HEARD = "#b3261e", "#5a6472"
MAP_WIDTH, MAP_HEIGHT = 640, 480
BAR_WIDTH = 200  # widest scale bar in pixels
BARS_M = [factor * 10**power for power in range(7) for factor in (1, 2, 5)]
STILL_M = 20.0  # metres within which a station counts as parked: GNSS fixes scatter


def drawn(plot: Plot) -> str:
    """Return a plot with its axes as SVG."""
    values = [value for one in plot.series for value in one.values if value is not None]
    low, high = min([0.0, *values]), max([0.0, *values]) or 1.0
    if not plot.from_zero:
        low, high = min(values) - 2, max(values) + 2
    first, last = plot.at[0], plot.at[-1] if plot.at[-1] > plot.at[0] else plot.at[0] + 1

    def x(value: float) -> float:
        return LEFT + (value - first) / (last - first) * (WIDTH - LEFT - RIGHT)

    def y(value: float) -> float:
        return HEIGHT - BOTTOM - (value - low) / (high - low) * (HEIGHT - BOTTOM - TOP)

    parts = [*_axes(plot, (first, last), (low, high), x, y)]
    for one in plot.series:
        parts += _bars(plot, one, x, y) if plot.bars else _line(plot, one, x, y)
    return f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{escape(plot.title)}">{"".join(parts)}</svg>'


def _axes(plot: Plot, across: tuple[float, float], up: tuple[float, float], x: Any, y: Any) -> Iterator[str]:
    for value in ticks(*up):
        yield f'<path d="M{LEFT} {y(value):.1f}H{WIDTH - RIGHT}" stroke="#e3e7eb"/>'
        yield f'<text x="{LEFT - 6}" y="{y(value) + 4:.1f}" text-anchor="end">{value:g}</text>'
    for value in ticks(*across):
        yield f'<text x="{x(value):.1f}" y="{HEIGHT - BOTTOM + 14}" text-anchor="middle">{value:g}</text>'
    yield f'<text x="{(LEFT + WIDTH - RIGHT) / 2}" y="{HEIGHT - 6}" text-anchor="middle">{escape(plot.x)}</text>'
    middle = (TOP + HEIGHT - BOTTOM) / 2
    yield f'<text x="12" y="{middle}" text-anchor="middle" transform="rotate(-90 12 {middle})">{escape(plot.y)}</text>'


def _line(plot: Plot, one: Series, x: Any, y: Any) -> Iterator[str]:
    step = max(1, len(plot.at) // DOTS)
    path, is_down = [], False
    for at, value in list(zip(plot.at, one.values, strict=True))[::step]:
        if value is None:
            is_down = False
            continue
        path.append(f"{'L' if is_down else 'M'}{x(at):.1f} {y(value):.1f}")
        is_down = True
        if one.points:
            yield f'<circle cx="{x(at):.1f}" cy="{y(value):.1f}" r="2" fill="{one.colour}"/>'
    yield f'<path d="{"".join(path)}" fill="none" stroke="{one.colour}" stroke-width="1.5"/>'


def _bars(plot: Plot, one: Series, x: Any, y: Any) -> Iterator[str]:
    width = (x(plot.at[-1]) - x(plot.at[0])) / max(1, len(plot.at) - 1)
    for at, value in zip(plot.at, one.values, strict=True):
        if value:
            top = y(value)
            yield (
                f'<rect x="{x(at):.1f}" y="{top:.1f}" width="{max(0.5, width - 0.5):.1f}" '
                f'height="{y(0) - top:.1f}" fill="{one.colour}"/>'
            )


def ticks(low: float, high: float, most: int = 6) -> list[float]:
    """Return about five round numbers between two values."""
    raw = (high - low) / most
    if raw <= 0 or not math.isfinite(raw):
        return [low]
    size = 10 ** math.floor(math.log10(raw))
    step = next(factor * size for factor in (1, 2, 2.5, 5, 10) if factor * size >= raw * 0.999)
    first = math.ceil(low / step - 1e-9)
    return [round(place * step, 12) for place in range(first, math.floor(high / step + 1e-9) + 1)]


def strength(rssi_dbm: float | None) -> str:
    """Return the colour of a signal strength; grey if it is unknown."""
    if rssi_dbm is None:
        return HEARD
    return next((colour for least, colour in STRENGTHS if rssi_dbm <= least), STRENGTHS[-1][1])


def end_of(spots: Sequence[Mapping[str, Any]]) -> str:
    """Return the end whose positions the map shows: "sender", or "receiver" if only the receiver moves."""
    known = [spot for spot in spots if spot["receiver"] is not None]
    if not known or _extent(_metres(spots, "sender")) > STILL_M:
        return "sender"
    return "receiver" if _extent(_metres(known, "receiver")) > STILL_M else "sender"


def _metres(spots: Sequence[Mapping[str, Any]], end: str) -> list[tuple[float, float]]:
    """Return positions as metres to the east and north."""
    narrow = math.cos(math.radians(sum(spot[end][0] for spot in spots) / len(spots)))
    return [(spot[end][1] * narrow * METRES, spot[end][0] * METRES) for spot in spots]


def _extent(points: Sequence[tuple[float, float]]) -> float:
    return max(max(point[axis] for point in points) - min(point[axis] for point in points) for axis in (0, 1))


def mapped(spots: Sequence[Mapping[str, Any]]) -> str:
    """Return a map of the places where messages were sent, as SVG with north up and a scale; empty without messages."""
    if not spots:
        return ""
    end = end_of(spots)
    spots = [spot for spot in spots if spot[end] is not None]
    points = _metres(spots, end)
    west, south = (min(point[axis] for point in points) for axis in (0, 1))
    east, north = (max(point[axis] for point in points) for axis in (0, 1))
    metres = max(east - west, (north - south) * MAP_WIDTH / MAP_HEIGHT, 20.0) * 1.12
    scale = MAP_WIDTH / metres
    parts = []
    # Arrived messages are drawn first, so that losses lie above them.
    for spot, (to_east, to_north) in sorted(zip(spots, points, strict=True), key=lambda pair: pair[0]["is_lost"]):
        x = MAP_WIDTH / 2 + (to_east - (east + west) / 2) * scale
        y = MAP_HEIGHT / 2 - (to_north - (north + south) / 2) * scale
        if spot["is_lost"]:
            parts.append(f'<path d="M{x - 3:.1f} {y - 3:.1f}l6 6m-6 0l6-6" stroke="{LOST}" stroke-width="1.5"/>')
        else:
            parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="2.5" fill="{strength(spot["rssi_dbm"])}"/>')
    size = next(size for size in reversed(BARS_M) if size * scale <= BAR_WIDTH)
    left, bottom = 16, MAP_HEIGHT - 16
    parts.append(f'<path d="M{left} {bottom - 6}v6h{size * scale:.1f}v-6" fill="none" stroke="#1c2430"/>')
    parts.append(f'<text x="{left + 6}" y="{bottom - 8}">{f"{size} m" if size < 1000 else f"{size // 1000} km"}</text>')
    parts.append(f'<text x="{MAP_WIDTH - 24}" y="24">N</text><path d="M{MAP_WIDTH - 20} 46v-16l-4 6m4-6l4 6" ')
    parts.append('fill="none" stroke="#1c2430"/>')
    return f'<svg viewBox="0 0 {MAP_WIDTH} {MAP_HEIGHT}" role="img" aria-label="map">{"".join(parts)}</svg>'
