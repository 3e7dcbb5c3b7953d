"""Words: counts violations of the rules of plain English in all texts.

usage: .ci/words [--names] [PATH ...], or python -m tests.words

PATH     files or folders, relative to the root. Default: all.
--names  prints file, line, rule and text of each violation.

Exits with 1 if a group has more violations than its goal: 0, or the committed count of words_allowed.json, which may only
fall. A new rule is one more row of RULES.
"""

import argparse
import ast
import io
import json
import re
import sys
import tokenize
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from tests.documents import FENCE
from tests.structure import OURS

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
ALLOWED = HERE / "words_allowed.json"
# Groups with the goal 0; those of the file have a committed count.
FREE = ("documents", "help", "messages", "module docstrings")
COUNTED = ("docstrings", "comments", "tests")
MOST_WORDS = 25
# Generated from help, docstrings and meanings, which are checked where they are written.
GENERATED = ("firmware/reference/", "asn1/backends/ros2/HASHES.md")
# Tables and logs of measurements, and the history: read by row, not in sequence.
RECORDS = ("CHANGELOG.md", "FIGURES.md", "tests/cases/README.md")
# Text that a rule finds and that stays: the end of its path, a part of it -> reason.
EXCEPTIONS = {("asn1/backends/ros2/names.py", "and as asm assert"): "a list of words, not a sentence"}

FIRST_WORDS = re.compile(r"^\W*(what|who|whose|whoever|whether|where|how|of)\b", re.IGNORECASE)
PHRASES = re.compile(
    r"\b(is|are|was|were) no(?! (longer|more|less|later|earlier|greater|larger|further|sooner)\b)\b"
    r"|\b(is|are|was|were) ((?-i:none)|told)\b|\bstands?\b(?! (by|alone|still)\b)|\bwhose word\b"
    r"|\b(nobody|somebody|whoever)\b|\bwhat is neither\b",
    re.IGNORECASE,
)
COMMENT_OF_TOOL = re.compile(r"^(!|type:|noqa|fmt:|pragma|ruff:|-\*-)")
SENTENCE_END = re.compile(r"(?<=[.!?])[\"')*]*\s+(?=[\"'(*`]?[A-Z0-9`])|;\s+")
PROSE = re.compile(r"[A-Za-z]{2,} [a-z]{2,}.* [a-z]{2,}")
CODE = re.compile(r"[{}]\s*$|#include|^\s*(def|class|import|from|return|static|typedef) |</|\\n\s+\w+ ", re.MULTILINE)


class Text(NamedTuple):
    """A paragraph, cell, message, comment or docstring; `may_ask` if it may begin with Whether."""

    path: str
    line: int
    group: str
    text: str
    may_ask: bool = False


class Finding(NamedTuple):
    """A violation of a rule by a text."""

    text: Text
    rule: str
    part: str


def first_word(text: Text) -> Iterator[str]:
    """Yield the start of a text that begins like a question and asks none."""
    found = FIRST_WORDS.match(text.text)
    if found is None or text.text.rstrip().endswith("?"):
        return
    if not (text.may_ask and found[1].lower() == "whether"):
        yield text.text[:60]


def phrases(text: Text) -> Iterator[str]:
    """Yield paraphrases of a field's noun, with the words around them."""
    for found in PHRASES.finditer(text.text):
        yield text.text[max(0, found.start() - 25) : found.end() + 25]


def long_sentence(text: Text) -> Iterator[str]:
    """Yield the start of each sentence with more than MOST_WORDS words; code in backticks is one word."""
    plain = re.sub(r"`[^`]*`", "code", text.text)
    for sentence in SENTENCE_END.split(plain):
        words = [word for word in sentence.split() if re.search(r"\w", word)]
        if len(words) > MOST_WORDS:
            yield f"{len(words)} words: {sentence.strip()[:60]}"


RULES: dict[str, Callable[[Text], Iterator[str]]] = {
    "first word": first_word,
    "phrase": phrases,
    "long sentence": long_sentence,
}


def findings(texts: Iterable[Text]) -> list[Finding]:
    """Return all violations, without EXCEPTIONS."""
    return [
        Finding(text, rule, " ".join(part.split()))
        for text in texts
        for rule, find in RULES.items()
        for part in find(text)
        if not any(text.path.endswith(path) and known in text.text for path, known in EXCEPTIONS)
    ]


def texts_below(root: Path, prefixes: tuple[str, ...] = ("",)) -> Iterator[Text]:
    """Yield texts of a tree: documents, code and the help of make; those whose paths begin with one of prefixes."""
    folders = [root / name for name in (*OURS, "tests")]
    code = {path for folder in folders for path in folder.rglob("*.py")}
    documents = {path for folder in (root, *folders) for path in _documents(folder, root)}
    for path in sorted({*code, *documents, root / "Makefile"}):
        name = path.relative_to(root).as_posix()
        if name.startswith(prefixes):
            read = of_code if path in code else of_document if path in documents else of_makefile
            yield from read(name, path.read_text())


def _documents(folder: Path, root: Path) -> Iterator[Path]:
    for path in folder.glob("*.md") if folder == root else folder.rglob("*.md"):
        name = path.relative_to(root).as_posix()
        if not name.startswith(GENERATED) and not name.endswith(RECORDS) and "/build/" not in name:
            yield path


def of_makefile(path: str, source: str) -> Iterator[Text]:
    """Yield the help of each target."""
    for number, line in enumerate(source.splitlines(), 1):
        if found := re.match(r"^[a-z0-9-]+:.*## (.*)", line):
            yield Text(path, number, "help", found[1])


def of_document(path: str, source: str) -> Iterator[Text]:
    """Yield paragraphs, list items, headings and table cells. Fenced blocks have no prose."""
    group = "tests" if path.startswith("tests/") else "documents"
    blank = FENCE.sub(lambda found: "\n" * found[0].count("\n"), source)
    start, lines = 0, list[str]()
    for number, line in enumerate([*blank.splitlines(), ""], 1):
        stripped = line.strip()
        if not stripped or stripped.startswith(("|", "#", "- ", "* ")) or re.match(r"^\d+\. ", stripped):
            if lines:
                yield Text(path, start, group, _without_markup(" ".join(lines)))
            start, lines = number, []
        if stripped.startswith("|"):
            for cell in re.split(r"(?<!\\)\|", stripped)[1:-1]:
                yield Text(path, number, group, _without_markup(cell))
        elif stripped and not stripped.startswith("#"):
            lines.append(stripped)
            start = start if len(lines) > 1 else number


def _without_markup(text: str) -> str:
    return re.sub(r"\]\([^)]*\)", "]", text).replace("[", "").replace("]", "").strip(" *-")


def of_code(path: str, source: str) -> Iterator[Text]:
    """Yield docstrings, comments, help and messages of a module."""
    is_test = path.startswith("tests/")
    tree = ast.parse(source)
    documented = list(_docstrings(tree))
    for node, constant in documented:
        group = "module docstrings" if isinstance(node, ast.Module) else "tests" if is_test else "docstrings"
        may_ask = isinstance(node, ast.FunctionDef) and node.returns is not None and "bool" in ast.unparse(node.returns)
        yield from _units(path, constant.lineno, group, constant.value, may_ask)
    yield from _comments(path, source, "tests" if is_test else "comments")
    if not is_test:
        yield from _strings(path, tree, {id(constant) for _, constant in documented})


def _docstrings(tree: ast.Module) -> Iterator[tuple[ast.AST, ast.Constant]]:
    for node in ast.walk(tree):
        if not isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef) or not node.body:
            continue
        first = node.body[0]
        if isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant) and isinstance(first.value.value, str):
            yield node, first.value


def _units(path: str, line: int, group: str, docstring: object, may_ask: bool) -> Iterator[Text]:
    """Split a docstring into paragraphs and rows of `name  meaning`. Only its first unit has a first word."""
    for number, paragraph in enumerate(re.split(r"\n\s*\n|\n(?=\s*[\w.*`'/\[\]<>, -]+?  +\S)", str(docstring))):
        if not re.match(r"\s*(usage:|Face:|Commands:|# )", paragraph):  # `# ` is a row of a table of states
            yield Text(path, line, group, " ".join(paragraph.split()), may_ask or number > 0)


def _comments(path: str, source: str, group: str) -> Iterator[Text]:
    start, last, lines = 0, -1, list[str]()
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type != tokenize.COMMENT or COMMENT_OF_TOOL.match(token.string[1:].strip()):
            continue
        is_whole_line = token.line.strip().startswith("#")
        if not (is_whole_line and token.start[0] == last + 1):
            if lines:
                yield Text(path, start, group, " ".join(lines))
            start, lines = token.start[0], []
        lines.append(token.string[1:].strip())
        last = token.start[0] if is_whole_line else -1
    if lines:
        yield Text(path, start, group, " ".join(lines))


def _strings(path: str, tree: ast.Module, docstrings: set[int]) -> Iterator[Text]:
    """Yield strings that a person reads: help, and messages of three words or more."""
    inside = set[int]()
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            inside |= {id(value) for value in node.values}
            yield from _message(path, node.lineno, "messages", _joined(node))
    helps = {
        id(keyword.value)
        for node in ast.walk(tree)
        if isinstance(node, ast.Call)
        for keyword in node.keywords
        if keyword.arg in ("help", "description", "epilog")
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in inside | docstrings:
            yield from _message(path, node.lineno, "help" if id(node) in helps else "messages", node.value)


def _joined(node: ast.JoinedStr) -> str:
    return "".join(str(one.value) if isinstance(one, ast.Constant) else "VALUE" for one in node.values)


def _message(path: str, line: int, group: str, text: str) -> Iterator[Text]:
    if PROSE.search(text) and not CODE.search(text):
        for paragraph in re.split(r"\n\s*\n|\n(?=\s*\S+  +\S)", text):
            if not paragraph.lstrip().startswith("examples:"):  # command lines with a word on each
                yield Text(path, line, group, " ".join(paragraph.split()))


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__.partition("\n")[0], usage=".ci/words [--names] [--allow] [PATH ...]"
    )
    parser.add_argument("paths", nargs="*", metavar="PATH")
    parser.add_argument("--names", action="store_true", help="print each violation")
    parser.add_argument("--allow", action="store_true", help="write the counts that fell to words_allowed.json")
    asked = parser.parse_args()
    found = findings(texts_below(ROOT, tuple(asked.paths) or ("",)))
    counts = Counter(one.text.group for one in found)
    allowed: dict[str, int] = dict.fromkeys(FREE, 0) | json.loads(ALLOWED.read_text())
    print(f"{'group':20}{'violations':>12}{'at most':>10}")
    for group in (*FREE, *COUNTED):
        print(f"{group:20}{counts[group]:12}{allowed[group]:10}")
    for one in found if asked.names else ():
        print(f"{one.text.path}:{one.text.line}: {one.text.group}: {one.rule}: {one.part}")
    if asked.allow and not asked.paths:
        lower = {group: min(allowed[group], counts[group]) for group in COUNTED}
        ALLOWED.write_text(json.dumps(lower, indent=1) + "\n")
    return int(any(counts[group] > allowed[group] for group in (*FREE, *COUNTED)))


if __name__ == "__main__":
    sys.exit(main())
