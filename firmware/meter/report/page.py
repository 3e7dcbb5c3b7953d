"""Report: HTML file without network requests, JSON and GeoJSON."""

import json
from collections.abc import Iterator, Mapping
from html import escape
from pathlib import Path
from typing import Any

import firmware
from board.runtime.errors import StationError
from firmware import file_remedy
from firmware.client.show.table import Table
from firmware.meter.report import drawing, text
from firmware.meter.report.plot import Plot, plots
from firmware.printable import clean

Object = Mapping[str, Any]
ASSETS = Path(firmware.__file__).parent / "meter" / "assets"
# uPlot 1.6.32 (MIT): two unchanged files of its package; tests/firmware/meter/report/test_page.py has their hashes.
SCRIPTS = ("uPlot.iife.min.js", "page.js")
STYLES = ("uPlot.min.css", "page.css")
# The policy forbids all requests, even if text from a message contains markup.
POLICY = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:"


def paths(path: Path) -> tuple[Path, Path, Path]:
    """Return the paths of the three files, the page first."""
    return path, path.with_suffix(".json"), path.with_suffix(".geojson")


def write(result: Object, path: Path) -> Iterator[Path]:
    """Write page, JSON and GeoJSON, and yield their paths. Raises StationError if a file cannot be written."""
    written = (page(result), json.dumps(result, indent=1), json.dumps(geojson(result)))
    for target, octets in zip(paths(path), written, strict=True):
        try:
            target.write_text(octets, encoding="utf-8")
        except OSError as error:
            raise StationError(f"--report: {target}: {error.strerror}", file_remedy.to_write(error)) from error
        yield target


def page(result: Object) -> str:
    """Return the page as HTML."""
    made = list(plots(result))
    styles = "".join((ASSETS / name).read_text(encoding="utf-8") for name in STYLES)
    scripts = "".join(f"<script>{(ASSETS / name).read_text(encoding='utf-8')}</script>" for name in SCRIPTS)
    numbers = {plot.key: {**plot._asdict(), "series": [one._asdict() for one in plot.series]} for plot in made}
    return (
        '<!DOCTYPE html><html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{_text(result['title'])}</title><style>{styles}</style></head><body>"
        f"{_head(result)}{''.join(_body(result, made))}"
        f'<script type="application/json" id="plots">{_json(numbers)}</script>{scripts}</body></html>\n'
    )


def geojson(result: Object) -> dict[str, object]:
    """Return the places where messages were sent and their fates as GeoJSON (RFC 7946)."""
    return {
        "type": "FeatureCollection",
        "features": [
            {
                "type": "Feature",
                "geometry": {"type": "Point", "coordinates": spot["sender"][::-1]},
                "properties": {key: value for key, value in spot.items() if key != "sender"},
            }
            for spot in result["map"]
        ],
    }


def _head(result: Object) -> str:
    about = (
        f"{result['began']}, {result['duration_s']:.1f} s, T = {1000 * result['interval_s']:.0f} ms, "
        f"{result['what']}, captain {result['captain']}"
    )
    tiles = "".join(_tile(one) for one in result["ways"])
    notes = "".join(f'<p class="note">{_text(note)}</p>' for note in result["notes"])
    return (
        f"<h1>{_text(result['title'])}</h1><p class='about'>{_text(about)}</p><div class='tiles'>{tiles}</div>{notes}"
    )


def _tile(one: Object) -> str:
    lossy = " lossy" if one["lost"] else ""
    delay, doubt = (text.duration(one[key], "median") for key in ("one_way_us", "one_way_doubt_us"))
    return (
        f'<div class="tile{lossy}"><span>{_text(one["way"])}</span><b>{text.share(one["loss"])} lost</b>'
        f"<span>{one['arrived']} of {one['sent']} arrived; delay {delay}, +- {doubt}; "
        f"longest gap {text.duration(one['gap_s'], 'most', 1e6)}</span></div>"
    )


def _body(result: Object, made: list[Plot]) -> Iterator[str]:
    for table in text.tables({**result, "notes": []}):
        yield _table(table._replace(title="Loss and order") if table.title.startswith(result["title"]) else table)
    if result["map"]:
        yield "<h2>Where messages were sent</h2>" + _map(result)
    if made:
        yield f'<h2>Time lines and distributions</h2><div class="plots">{"".join(map(_figure, made))}</div>'


def _table(table: Table) -> str:
    marks = [' class="n"' if head.startswith(">") else "" for head in table.heads]
    named = zip(table.heads, marks, strict=True)
    heads = "".join(f"<th{mark}>{_text(head.removeprefix('>'))}</th>" for head, mark in named)
    rows = "".join(
        "<tr>" + "".join(f"<td{mark}>{_text(cell)}</td>" for cell, mark in zip(row, marks, strict=True)) + "</tr>"
        for row in table.rows
    )
    notes = "".join(f'<p class="note">{_text(note)}</p>' for note in table.notes)
    return (
        f'<h2>{_text(table.title)}</h2><div class="scroll"><table><thead><tr>{heads}</tr></thead>'
        f"<tbody>{rows}</tbody></table></div>{notes}"
    )


def _figure(plot: Plot) -> str:
    keys = "".join(f'<span><i style="background:{one.colour}"></i>{_text(one.name)}</span>' for one in plot.series)
    return (
        f'<figure class="drawn" data-plot="{escape(plot.key)}"><figcaption>{_text(plot.title)}</figcaption>'
        f'{drawing.drawn(plot)}<div class="keys">{keys}</div></figure>'
    )


def _map(result: Object) -> str:
    strengths = [(colour, f"to {least:g} dBm") for least, colour in drawing.STRENGTHS[:-1]]
    strengths.append((drawing.STRENGTHS[-1][1], f"above {drawing.STRENGTHS[-2][0]:g} dBm"))
    others = [(drawing.HEARD, "strength not known"), (drawing.LOST, "lost")]
    keys = "".join(f'<span><i style="background:{colour}"></i>{name}</span>' for colour, name in strengths + others)
    figures = "".join(
        f"<figure><figcaption>{_text(_caption(way, spots, result['map_more']))}</figcaption>{drawing.mapped(spots)}"
        f'<div class="keys">{keys}</div></figure>'
        for way, spots in _by_way(result)
    )
    return f'<div class="plots">{figures}</div>'


def _caption(way: str, spots: list[Object], more: int) -> str:
    guessed = sum(spot["is_guessed"] for spot in spots)
    words = f"{way}: each message at the position of its {drawing.end_of(spots)}, coloured by signal strength"
    words += f"; {guessed} of {len(spots)} at positions that are interpolated" if guessed else ""
    return words + (f"; {more} more are not shown" if more else "")


def _by_way(result: Object) -> Iterator[tuple[str, list[Object]]]:
    for way in sorted({spot["way"] for spot in result["map"]}):
        yield way, [spot for spot in result["map"] if spot["way"] == way]


def _text(words: object) -> str:
    return escape(clean(str(words)))


def _json(value: object) -> str:
    """Return JSON that is safe inside a script element: `<` is escaped, so that no text ends the element."""
    return json.dumps(value, separators=(",", ":")).replace("<", "\\u003c")
