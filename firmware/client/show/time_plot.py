"""Plot of a station's time: offset, jitter and Allan deviation as one SVG."""

import math
import re
from collections.abc import Mapping, Sequence

import pygal
from pygal.style import Style

from firmware.client.show.status.clock import title
from firmware.client.show.time_record import Record
from firmware.clock.time_history import SecondRow
from firmware.printable import clean

WIDTH, HEIGHT = 960, 320  # pixels of each of the three plots
DOTS = 600  # points of a curve; more are not visible at this width

STYLE = Style(
    background="white",
    plot_background="white",
    font_family="sans-serif",
    colors=("#1f5fa8", "#c0504d", "#c0504d", "#4f8f4f"),
    title_font_size=15,
    label_font_size=11,
    major_label_font_size=11,
    legend_font_size=11,
)
COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)
SCRIPT = re.compile(r"<script\b.*?</script>", re.DOTALL)


def picture(kept: Record, clock: Mapping[str, object], deviations: Sequence[tuple[float, float]]) -> str:
    """Return the plots of a time record as one SVG.

    kept        record of the station's time.
    clock       time section of the status, for the title.
    deviations  pairs of tau in seconds and Allan deviation of the oscillator.
    """
    # The minutes of the last day, or the seconds while there are too few minutes.
    rows = kept.minutes if len(kept.minutes) > 60 else kept.seconds
    charts = (_offset(rows, clean(title(clock))), _jitter(rows), _allan(deviations))
    parts = [
        f'<svg y="{at * HEIGHT}" width="{WIDTH}" height="{HEIGHT}">{_drawn(chart)}</svg>'
        for at, chart in enumerate(charts)
    ]
    size = f'width="{WIDTH}" height="{HEIGHT * len(charts)}"'
    return f'<svg xmlns="http://www.w3.org/2000/svg" {size}>\n' + "\n".join(parts) + "\n</svg>\n"


def _drawn(chart: pygal.XY) -> str:
    """Return a chart as SVG without comments, which contain URLs, and without scripts: the file loads nothing."""
    return SCRIPT.sub("", COMMENT.sub("", str(chart.render(is_unicode=True, disable_xml_declaration=True))))


def _chart(title: str, x_title: str, y_title: str, **more: object) -> pygal.XY:
    return pygal.XY(
        title=title,
        x_title=x_title,
        y_title=y_title,
        width=WIDTH,
        height=HEIGHT,
        style=STYLE,
        js=(),
        show_dots=False,
        legend_at_bottom=True,
        no_data_text="nothing yet",
        **more,
    )


def _offset(rows: Sequence[SecondRow], title: str) -> pygal.XY:
    chart = _chart(title, "hours ago", "us", x_value_formatter=_ago)
    last_s = rows[-1].its_s
    bounds = {"earliest": -1.0, "latest": 1.0}
    chart.add("true time minus system clock", _points(rows, last_s, [row.offset_ns for row in rows]))
    for name, sign in bounds.items():
        values = [row.offset_ns + sign * row.uncertainty_ns for row in rows]
        chart.add(f"at the {name}, 99.9 %", _points(rows, last_s, values))
    return chart


def _jitter(rows: Sequence[SecondRow]) -> pygal.XY:
    chart = _chart(
        "jitter: standard deviation of the pulses from the estimate",
        "hours ago",
        "us",
        show_legend=False,
        x_value_formatter=_ago,
    )
    chart.add("standard deviation", _points(rows, rows[-1].its_s, [row.jitter_ns for row in rows]))
    return chart


def _allan(deviations: Sequence[tuple[float, float]]) -> pygal.XY:
    """Return the plot of the Allan deviation over tau, both axes logarithmic.

    pygal supports one logarithmic axis only, so the points are given as exponents.
    """
    chart = _chart(
        "Allan deviation of the oscillator, overlapping",
        "tau, s",
        "",
        show_legend=False,
        x_value_formatter=lambda exponent: f"{10**exponent:g}",
        value_formatter=lambda exponent: f"{10**exponent:.1e}",
    )
    points = [(math.log10(tau_s), math.log10(deviation)) for tau_s, deviation in deviations if deviation > 0]
    if points:
        chart.x_labels = range(math.ceil(max(x for x, _ in points)) + 1)
        chart.y_labels = range(math.floor(min(y for _, y in points)), math.ceil(max(y for _, y in points)) + 1)
        chart.show_dots = True
    chart.add("sigma", points)
    return chart


def _ago(hours: float) -> str:
    return f"{abs(hours):g}"


def _points(rows: Sequence[SecondRow], last_s: float, values_ns: Sequence[float]) -> list[tuple[float, float] | None]:
    """Return points (hours before the last row, microseconds), at most DOTS; None marks a gap."""
    step = -(-len(rows) // DOTS)
    drawn = list(zip(rows, values_ns, strict=True))[::step]
    return [None if math.isnan(value) else ((row.its_s - last_s) / 3600, value / 1000) for row, value in drawn]
