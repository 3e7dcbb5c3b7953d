"""Picture of the data flow: boxes, arrows and labels as SVG.

usage: python -m tests.reference.data_flow, or make reference

Writes firmware/guide/data-flow.svg, the picture of README. Same input, same octets.
"""

from pathlib import Path
from typing import NamedTuple
from xml.sax.saxutils import escape

PICTURE = Path(__file__).resolve().parents[2] / "firmware/guide/data-flow.svg"
WIDTH, HEIGHT = 930, 372
LINE = 17  # pixels from one line of text to the next


class Box(NamedTuple):
    """A rectangle in pixels; its first line is the title."""

    x: int
    y: int
    width: int
    height: int
    lines: tuple[str, ...]
    fill: str = "#ffffff"


class Arrow(NamedTuple):
    """From left to right, or back; in pixels, with a label above."""

    start: int
    end: int
    y: int
    label: str


STATION = Box(282, 12, 356, 348, ("captain run",), "#eef3fa")
BOXES = (
    STATION,
    Box(12, 44, 170, 68, ("ITS-G5", "SOM301-E, 802.11p card", "som301e, ethernet")),
    Box(12, 124, 170, 68, ("Network, serial line", "udp, uart, ipc")),
    Box(12, 204, 170, 68, ("5G: MQTT broker", "mqtt, sim8202g")),
    Box(12, 284, 170, 68, ("GNSS, 1PPS", "zed_f9p")),
    Box(298, 44, 112, 308, ("Drivers", "", "one for each", "interface;", "GeoNetworking,", "BTP")),
    Box(424, 44, 92, 228, ("Routing", "", "duplicates,", "plausibility,", "policy,", "queues,", "confirms")),
    Box(530, 44, 92, 228, ("Endpoint", "", "ZeroMQ,", "four ports")),
    Box(424, 284, 198, 68, ("Time and position", "offset, bound, leap seconds")),
    Box(
        768,
        44,
        150,
        148,
        ("Your programs", "Python, C++, ROS 2", "", "captain listen", "captain send", "captain record"),
    ),
    Box(768, 204, 150, 148, ("Operator", "captain status", "captain console", "captain doctor")),
)
ARROWS = (
    Arrow(182, 298, 72, "frames"),
    Arrow(298, 182, 94, ""),
    Arrow(182, 298, 152, "PDUs"),
    Arrow(298, 182, 174, ""),
    Arrow(182, 298, 232, "topics"),
    Arrow(298, 182, 254, ""),
    Arrow(182, 298, 318, "pulses, fixes"),
    Arrow(622, 768, 72, "SUB 5556: received"),
    Arrow(768, 622, 112, "PUB 5555: to send"),
    Arrow(768, 622, 152, "PUSH 5557: to send"),
    Arrow(622, 768, 232, "SUB 5558: reports"),
    Arrow(768, 638, 318, "Unix socket"),
)


def picture() -> str:
    """Return the picture as an SVG document."""
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif" font-size="12">',
        '<defs><marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="8" markerHeight="8" orient="auto">'
        '<path d="M0 0 8 4 0 8z" fill="#34495e"/></marker></defs>',
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="#ffffff"/>',
        *(part for box in BOXES for part in _box(box)),
        *(part for arrow in ARROWS for part in _arrow(arrow)),
        "</svg>",
    ]
    return "\n".join(parts) + "\n"


def _box(box: Box) -> list[str]:
    found = [
        f'<rect x="{box.x}" y="{box.y}" width="{box.width}" height="{box.height}" rx="6" fill="{box.fill}"'
        ' stroke="#34495e"/>'
    ]
    for number, line in enumerate(box.lines):
        style = ' font-weight="bold"' if not number else ""
        found.append(f'<text x="{box.x + 8}" y="{box.y + 20 + number * LINE}"{style}>{escape(line)}</text>')
    return found


def _arrow(arrow: Arrow) -> list[str]:
    middle = (arrow.start + arrow.end) // 2
    return [
        f'<path d="M{arrow.start} {arrow.y}H{arrow.end}" stroke="#34495e" fill="none" marker-end="url(#tip)"/>',
        f'<text x="{middle}" y="{arrow.y - 5}" text-anchor="middle" font-size="11">{escape(arrow.label)}</text>',
    ]


if __name__ == "__main__":
    PICTURE.write_text(picture())
