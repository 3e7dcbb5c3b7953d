"""Report in a real browser: python -m tests.firmware.meter.browser build/meter-table3.html

Headless Chromium opens it in a wide window, in one as wide as a phone's, and for paper. Each plot is drawn, and
nothing is wider than the phone. It requests nothing that the browser does not request with an empty page as well. The
pictures are for looking at.
"""

import argparse
import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple
from urllib.parse import urlsplit

CHROMIUM = (
    "chromium", "--headless=new", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync", "--allow-file-access-from-files",
    "--virtual-time-budget=5000", "--host-resolver-rules=MAP * ~NOTFOUND",
)  # fmt: skip
WIDE, PHONE = (1280, 2600), (390, 3600)
LEAST_WINDOW = 500  # pixels: the browser makes none that is narrower, so the phone is a frame in it
LIMIT_S = 120
# A page around the report, as wide as a phone, which says how wide that has become.
FRAME = """<!DOCTYPE html><html><body style="margin:0"><iframe src="{url}" width="{width}" height="{height}"
style="border:0"></iframe><p id="said"></p><script>const frame = document.querySelector("iframe");
frame.onload = () => setTimeout(() => {{ document.getElementById("said").textContent =
"wide " + frame.contentDocument.documentElement.scrollWidth; }}, 1000);</script></body></html>"""


class Seen(NamedTuple):
    """figures: that are to be drawn anew, and plots that were; width: of the page on the phone; asked: of others."""

    figures: int
    plots: int
    width: int
    asked: list[str]
    pictures: list[Path]

    @property
    def is_right(self) -> bool:
        return self.figures == self.plots > 0 and self.width <= PHONE[0] and not self.asked


def look(page: Path, folder: Path) -> Seen:
    """Open it some times; pictures go into the folder."""
    url, stem = page.absolute().as_uri(), folder / page.stem
    with tempfile.TemporaryDirectory() as own:
        log, empty = Path(own) / "net.json", Path(own) / "empty.html"
        empty.write_text("<!DOCTYPE html><title></title>")
        _run(own, f"--log-net-log={log}", "--dump-dom", empty.as_uri())
        own_hosts = _hosts(log)
        dom = _run(own, f"--window-size={WIDE[0]},{WIDE[1]}", f"--log-net-log={log}", "--dump-dom", url)
        asked = sorted(_hosts(log) - own_hosts)
        _run(own, f"--window-size={WIDE[0]},{WIDE[1]}", f"--screenshot={stem}.wide.png", url)
        frame = Path(own) / "phone.html"
        frame.write_text(FRAME.format(url=url, width=PHONE[0], height=PHONE[1]))
        size = f"--window-size={LEAST_WINDOW},{PHONE[1]}"
        said = _run(own, size, "--dump-dom", frame.as_uri())
        _run(own, size, f"--screenshot={stem}.phone.png", frame.as_uri())
        _run(own, f"--print-to-pdf={stem}.pdf", "--no-pdf-header-footer", url)
    wide = re.search(r"wide (\d+)", said)
    return Seen(
        len(re.findall(r'<figure class="drawn"', dom)),
        len(re.findall(r'class="uplot', dom)),
        int(wide[1]) if wide else sys.maxsize,
        asked,
        [Path(f"{stem}.{end}") for end in ("wide.png", "phone.png", "pdf")],
    )


def _run(own: str, *arguments: str) -> str:
    command = [*CHROMIUM, f"--user-data-dir={own}/profile", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=LIMIT_S, check=True).stdout


def _hosts(log: Path) -> set[str]:
    """Of all that was requested, by the browser's own log of its network; files have none."""
    events = json.loads(log.read_text())["events"]
    urls = [event["params"]["url"] for event in events if "url" in event.get("params", {})]
    return {host for url in urls if (host := urlsplit(url).hostname)}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("page", type=Path)
    parser.add_argument("--to", type=Path, default=Path("build"), help="folder of the pictures")
    arguments = parser.parse_args()
    seen = look(arguments.page, arguments.to)
    print(f"{seen.plots} of {seen.figures} plots drawn; {seen.width} pixels wide on a phone of {PHONE[0]}")
    print(f"asked of others: {', '.join(seen.asked) or 'nothing'}")
    print("to look at: " + ", ".join(map(str, seen.pictures)))
    return 0 if seen.is_right else 1


if __name__ == "__main__":
    sys.exit(main())
