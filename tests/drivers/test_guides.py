"""Guides of drivers: a page for each, with the same headings; their messages exist."""

import errno
import os
import re
from pathlib import Path

import pytest

from drivers import DRIVERS
from tests.documents import FENCE, blocks

ROOT = Path(__file__).resolve().parents[2]
GUIDES = ROOT / "drivers" / "guide"
HEADINGS = ["Description", "Wiring", "Options", "Operation", "Symptoms of failure"]
# Folders whose code has the messages that the pages may quote.
SOURCES = ("drivers", "board", "firmware/doctor")


def page(name: str) -> str:
    return (GUIDES / f"{name}.md").read_text()


def code() -> str:
    """Return all sources, with string literals of several lines joined, and the kernel's messages."""
    texts = [path.read_text() for folder in SOURCES for path in sorted((ROOT / folder).rglob("*.py"))]
    kernel = [os.strerror(number).lower() for number in errno.errorcode]
    return re.sub(r'"\s*\n\s*f?"', "", "\n".join([*texts, *kernel]))


CODE = code()


def symptoms(name: str) -> list[str]:
    """Return the code spans in the first cells of the page's last table."""
    rows = re.findall(r"^\| (.*?) \|", page(name).partition("\n## Symptoms of failure\n")[2], re.MULTILINE)
    return [span for row in rows for span in re.findall(r"`([^`]+)`", row)]


@pytest.mark.parametrize("name", DRIVERS)
def test_guide_of_a_driver_has_the_headings_of_all(name: str) -> None:
    text = page(name)
    assert re.findall(r"^#+ .*", FENCE.sub("", text), re.MULTILINE) == [
        f"# Interface `{name}`",
        *(f"## {heading}" for heading in HEADINGS),
    ]


@pytest.mark.parametrize("name", DRIVERS)
def test_table_of_drivers_links_the_guide_of_each(name: str) -> None:
    assert re.search(
        rf"^\| `{name}` \|.*\]\(guide/{name}\.md\)", (ROOT / "drivers/README.md").read_text(), re.MULTILINE
    )


@pytest.mark.parametrize("name", DRIVERS)
def test_guide_of_a_driver_has_an_example_of_its_options(name: str) -> None:
    example = page(name).partition("\n## Options\n")[2].partition("\n## ")[0]
    assert f'\ndriver = "{name}"' in example
    assert f"](../../firmware/reference/options.md#interfaces-{name})" in example


@pytest.mark.parametrize("name", DRIVERS)
def test_symptoms_in_the_guide_of_a_driver_are_texts_of_the_code(name: str) -> None:
    quoted = symptoms(name)
    assert quoted
    parts = [part for text in quoted for part in text.split(" ... ")]
    assert [part for part in parts if part not in CODE] == []


def test_symptoms_of_a_changed_message_are_not_in_the_code() -> None:
    assert "does not answer any longer" not in CODE


def test_commands_of_the_unit_are_those_of_the_page_for_ocb() -> None:
    text = page("ocb")
    (shown,), (unit,) = blocks(text, "sh ocb"), blocks(text, "ini ocb")
    run = [line.replace("%i", "wlan0") for line in re.findall(r"^ExecStart=(.*)", unit, re.MULTILINE)]
    assert run == shown.splitlines()[:-1]


@pytest.mark.parametrize("path", sorted(GUIDES.glob("*.md")), ids=lambda path: path.stem)
def test_guide_is_short_and_lists_its_headings(path: Path) -> None:
    text = path.read_text()
    headings = re.findall(r"^## (.*)", FENCE.sub("", text), re.MULTILINE)
    assert len(text.splitlines()) < 250
    assert re.findall(r"^- \[(.*?)\]\(#", text, re.MULTILINE)[: len(headings)] == headings
