"""Passages: draws docstrings, comments, messages and paragraphs of guides at random.

usage: python -m tests.passages [--count N] [--seed S] [PATH ...]

PATH  files or folders, relative to the root. Default: all of the product.

People explain each passage in one sentence without the code. Then the sentences are compared with the code.
A passage is printed as its reader meets it. A docstring has its name and parameters, and a comment its line of code. A
paragraph has its heading, and a table cell its row.
"""

import argparse
import ast
import random
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

from tests.structure import OURS
from tests.words import GENERATED, of_code, of_document

ROOT = Path(__file__).resolve().parent.parent
LEAST_WORDS = 6
FOLDERS = (*OURS, "README.md", "CONTRIBUTING.md")


class Passage(NamedTuple):
    """Text with its file and context: a name with parameters, or a line of code."""

    path: str
    beside: str
    text: str


def docstrings(path: str, source: str) -> Iterator[Passage]:
    """Yield docstrings of modules, classes and functions, each as a whole."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and (text := ast.get_docstring(node)):
            yield Passage(path, _heading(node), text)


def _heading(node: ast.Module | ast.ClassDef | ast.FunctionDef) -> str:
    if isinstance(node, ast.Module):
        return "module"
    if isinstance(node, ast.ClassDef):
        return f"class {node.name}"
    returns = f" -> {ast.unparse(node.returns)}" if node.returns else ""
    return f"def {node.name}({ast.unparse(node.args)}){returns}"


def comments(path: str, source: str) -> Iterator[Passage]:
    """Yield comments, each with its own line of code or the next one."""
    lines = source.splitlines()
    for text in of_code(path, source):
        if text.group != "comments":
            continue
        number = text.line - 1
        while number < len(lines) - 1 and lines[number].lstrip().startswith("#"):
            number += 1
        yield Passage(path, lines[number].partition("  #")[0].strip(), text.text)


def messages(path: str, source: str) -> Iterator[Passage]:
    """Yield messages and help; VALUE is in place of a value."""
    for text in of_code(path, source):
        if text.group in ("messages", "help"):
            yield Passage(path, text.group, text.text)


def paragraphs(path: str, source: str) -> Iterator[Passage]:
    """Yield paragraphs, list items and table cells, each with its heading; a cell with its row and the heads of columns."""
    lines = source.splitlines()
    for text in of_document(path, source):
        above = [line for line in lines[: text.line] if line.startswith(("## ", "### "))]  # `# ` may be in a program
        beside = (above or lines)[-1 if above else 0].lstrip("# ")
        if (row := lines[text.line - 1]).startswith("|"):
            first = text.line - 1
            while first and lines[first - 1].startswith("|"):
                first -= 1
            beside += f"\n{lines[first]}\n{row}"
        yield Passage(path, beside, text.text)


KINDS: dict[str, tuple[str, Callable[[str, str], Iterator[Passage]]]] = {
    "docstring": (".py", docstrings),
    "comment": (".py", comments),
    "message": (".py", messages),
    "guide": (".md", paragraphs),
}


def drawn(root: Path, count: int, seed: int, below: tuple[str, ...]) -> list[tuple[str, Passage]]:
    """Return kind and passage: as many of each kind, without those of fewer than LEAST_WORDS words."""
    files = sorted(path for name in FOLDERS for path in [root / name, *(root / name).rglob("*")] if path.is_file())
    names = {path.relative_to(root).as_posix(): path for path in files}
    chance = random.Random(seed)
    found = []
    for number, (kind, (ending, read)) in enumerate(KINDS.items()):
        all_of_kind = [
            passage
            for name, path in names.items()
            if name.endswith(ending) and name.startswith(below) and not name.startswith(GENERATED)
            for passage in read(name, path.read_text())
            if len(passage.text.split()) >= LEAST_WORDS
        ]
        share = count // len(KINDS) + (number < count % len(KINDS))
        found += [(kind, passage) for passage in chance.sample(all_of_kind, min(share, len(all_of_kind)))]
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("paths", nargs="*", metavar="PATH")
    parser.add_argument("--count", type=int, default=60, metavar="N", help="passages (60)")
    parser.add_argument("--seed", type=int, default=1, metavar="S", help="of the draw (1)")
    asked = parser.parse_args()
    print(f"seed {asked.seed}")
    for number, (kind, passage) in enumerate(drawn(ROOT, asked.count, asked.seed, tuple(asked.paths) or ("",)), 1):
        print(f"\n{number}. {kind} of {passage.path}{': ' if passage.beside else ''}{passage.beside}\n{passage.text}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
