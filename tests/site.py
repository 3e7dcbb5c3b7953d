"""Checks the built site: python -m tests.site build/docs. Links, anchors, addresses that a page loads, search."""

import json
import re
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

ELSEWHERE = re.compile(r"(https?:)?//")
LOADED = re.compile(r"""(?:url\(|@import)\s*["']?((?:https?:)?//[^"')\s]+)""")  # in a style sheet
TERM = "mosquitto"  # a word of drivers/guide/brokers.md that the search must find


class Page(HTMLParser):
    """Page of the site.

    anchors  ids of its elements.
    links    addresses that a reader follows.
    loads    addresses that a browser fetches with the page: scripts, style sheets, pictures.
    """

    def __init__(self, text: str) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.links: set[str] = set()
        self.loads: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = dict(attrs)
        self.anchors |= {value for key in ("id", "name") if (value := values.get(key))}
        if (address := values.get("href") or values.get("src")) is not None:
            (self.links if tag == "a" else self.loads).add(address)


def problems(site: Path) -> list[str]:
    """Return a line for each broken link or anchor, and for each address elsewhere that a page loads."""
    pages = {path.resolve(): Page(path.read_text(encoding="utf-8")) for path in sorted(site.rglob("*.html"))}
    found = []
    for path, page in pages.items():
        name = path.relative_to(site.resolve())
        for address in sorted(page.links | page.loads):
            parts = urlsplit(address)
            if parts.scheme or parts.netloc:
                if address in page.loads and ELSEWHERE.match(address):
                    found.append(f"{name}: loads {address}")
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            if not target.exists():
                found.append(f"{name}: broken link: {address}")
            elif parts.fragment and target in pages and unquote(parts.fragment) not in pages[target].anchors:
                found.append(f"{name}: broken anchor: {address}")
    for path in sorted(site.rglob("*.css")):
        found += [f"{path.relative_to(site)}: loads {one}" for one in LOADED.findall(path.read_text(encoding="utf-8"))]
    return found


def is_found(term: str, site: Path) -> bool:
    """Return whether the search index has a word. Raises OSError without an index."""
    text = (site / "searchindex.js").read_text(encoding="utf-8")
    return term in json.loads(text.removeprefix("Search.setIndex(").removesuffix(")"))["terms"]


def main(site: Path) -> int:
    found = problems(site)
    if not is_found(TERM, site):
        found.append(f"searchindex.js: {TERM}: not found")
    print(*found[:20], sep="\n", end="\n" if found else "")
    print(f"{site}/index.html: {len(list(site.rglob('*.html')))} pages, {len(found)} problems")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
