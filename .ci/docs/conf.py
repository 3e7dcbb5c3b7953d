"""Configuration of Sphinx for `make docs`: the site of all documents, which stay in their folders."""

from sphinx.application import Sphinx

project = html_title = "captain"
html_theme = "furo"
html_show_copyright = html_show_sourcelink = html_copy_source = False
extensions = ["myst_parser"]
myst_heading_anchors = 4
myst_ref_domains = ["std"]  # no names of Python and C++, whose search takes a third of the time

root_doc = "README"
MESSAGES = "build/messages"  # pages that captain-asn1 has generated
FOLDERS = ("asn1", "board", "drivers", "firmware", "image", "pps", "tests")
include_patterns = ["*.md", *(f"{folder}/**.md" for folder in FOLDERS), f"{MESSAGES}/*.md"]
exclude_patterns = [".*", "build/[!m]*", "**/template/**"]  # not searched; templates are parts of generated packages

# Navigation beside each page. Other pages are linked only: with all message pages, the build takes ten times as long.
NAVIGATION = {
    "Station": ["firmware/guide/*"],
    "Interfaces": ["drivers/guide/*"],
    "Messages": ["asn1/guide/*", f"{MESSAGES}/README"],
    "Box": ["board/guide/*", "pps/guide/*", "image/guide/*"],
    "Reference": ["firmware/reference/*"],
    "Development": ["CONTRIBUTING", "*/README", "CHANGELOG"],
}
# tests/site.py checks all links and anchors: MyST does not know those that message pages have as HTML.
suppress_warnings = ["toc.not_included", "myst.xref_missing", "misc.highlighting_failure"]


def _navigate(_: Sphinx, document: str, source: list[str]) -> None:
    """Append the navigation to the first page, which has no such directive: a Git host would show it."""
    if document == root_doc:
        for caption, patterns in NAVIGATION.items():
            rows = ["", "```{toctree}", ":hidden:", ":glob:", f":caption: {caption}", *patterns, "```", ""]
            source[0] += "\n".join(rows)


def setup(app: Sphinx) -> None:
    app.connect("source-read", _navigate)
