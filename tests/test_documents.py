"""Documents of the repository: links and paths of files in them exist."""

import argparse
import os
import re
from pathlib import Path

import pytest

from firmware.client.arguments import add_configuration
from firmware.config.board_file import BOARDS
from tests import documents
from tests.documents import FENCE

ROOT = Path(__file__).resolve().parent.parent
HISTORY = "CHANGELOG.md"  # names files of earlier releases

LINK = re.compile(r"\]\(([^)#\s]*)(?:#([^)\s]*))?\)")
HEADING = re.compile(r"^#+ (.+)$", re.MULTILINE)
CODE = re.compile(r"`([^`\n<>*]+)`")
PATH = re.compile(r"(?<![\w./-])(?:[\w.-]+/)*\w[\w.-]*\.(?:py|md)\b")


FILES = frozenset(path.relative_to(ROOT).as_posix() for path in documents.files(ROOT))
DOCUMENTS = sorted(name for name in FILES if name.endswith(".md") and name != HISTORY)


def missing_links(text: str, folder: str) -> list[str]:
    """Return relative links to absent files, and anchors that no heading of the linked document has."""
    missing = []
    for link, anchor in LINK.findall(FENCE.sub("", text)):
        target = ROOT / folder / link
        if ":" in link:
            continue
        if not target.exists():
            missing.append(link)
        elif anchor and anchor not in anchors(target.read_text() if link else text):
            missing.append(f"{link}#{anchor}")
    return missing


def anchors(text: str) -> set[str]:
    """Return the anchors of all headings."""
    return {documents.anchor(heading) for heading in HEADING.findall(FENCE.sub("", text))}


def missing_paths(text: str, folder: str, known: frozenset[str] = FILES) -> list[str]:
    """Return paths in code spans that are neither relative to the folder or the root, nor the end of one path below."""
    spans = CODE.findall(FENCE.sub("", text))
    named = [path for span in spans for path in PATH.findall(span) if path != "__init__.py"]
    return [path for path in named if not _is_one(path, folder, known)]


def _is_one(path: str, folder: str, known: frozenset[str]) -> bool:
    if path in known or os.path.normpath(f"{folder}/{path}") in known:
        return True
    below = "" if folder == "." else f"{folder}/"
    return sum(name.startswith(below) and name.endswith(f"/{path}") for name in known) == 1


@pytest.mark.parametrize("document", DOCUMENTS)
def test_document_with_relative_links_links_files_that_exist(document):
    assert missing_links((ROOT / document).read_text(), Path(document).parent.as_posix()) == []


@pytest.mark.parametrize("document", DOCUMENTS)
def test_document_with_paths_names_files_that_exist(document):
    assert missing_paths((ROOT / document).read_text(), Path(document).parent.as_posix()) == []


def test_missing_links_of_absent_file_and_anchor_returns_both():
    text = "# The board\n[a](README.md) [b](NONE.md) [c](#the-board) [d](#the-bord) [e](README.md#nothing)"
    assert missing_links(text, ".") == ["NONE.md", "#the-bord", "README.md#nothing"]


def test_missing_paths_of_moved_file_returns_its_old_path():
    known = frozenset({"drivers/wire/gnss/time.py", "drivers/README.md"})
    text = "`wire/gnss_time.py`, `wire/gnss/time.py`, `drivers/wire/gnss/time.py`, `gnss/time.py`"
    assert missing_paths(text, "drivers", known) == ["wire/gnss_time.py"]


def test_missing_paths_of_bare_name_of_two_files_returns_it():
    known = frozenset({"drivers/a/options.py", "drivers/b/options.py", "drivers/a/link.py"})
    assert missing_paths("`options.py` and `link.py`", "drivers", known) == ["options.py"]


@pytest.mark.parametrize("board", [path.stem for path in BOARDS.glob("*.toml")])
def test_guide_and_help_name_every_board(board):
    parser = argparse.ArgumentParser()
    add_configuration(parser)
    assert f"\n| `{board}` |" in (ROOT / "firmware/guide/configuration.md").read_text()
    assert re.search(rf"\b{board}\b", parser.format_help())
