"""Makes small mistakes in a folder; prints how many the tests notice.

usage: python -m tests.cover.mutants [--count N] [--seed N] [--jobs N] [--names] [--before COMMIT] FOLDER [TESTS ...]

FOLDER   of the product, such as firmware/card.
TESTS    files and folders of its tests. Default: the folder of the same name below tests.
--count  mistakes, chosen among all that can be made (500).
--seed   of the choice (1): the same seed and the same code give the same mistakes.
--jobs   side by side (2).
--names  prints the place of each that no test noticed.
--before  an earlier commit, which is checked out and set up in build/bench/before, to compare. Trees are copied, not changed.

A mistake is an inverted comparison, operator or condition, a number one higher, an empty text, or an omitted returned
value or call. Texts with a space in them stay as they are. The tests that execute its line run until one fails.
"""

import argparse
import ast
import random
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from itertools import chain
from pathlib import Path
from queue import SimpleQueue
from typing import NamedTuple

from tests import earlier
from tests.cover.measured import TestsFailedError, measure
from tests.cover.tree import copy_of, run_in

WAIT_S = 120
MISSED, NOTICED, NOT_EXECUTED = "missed", "noticed", "not executed"
AS_WRITTEN = argparse.RawDescriptionHelpFormatter
TURNED: dict[type[ast.AST], type[ast.AST]] = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.And: ast.Or,
    ast.Or: ast.And,
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.FloorDiv,
    ast.FloorDiv: ast.Mult,
}
# The line of a statement, what is changed in it, and what changes it.
Change = tuple[int, str, Callable[[], None]]
TYPES = ("annotation", "returns")  # fields that no program runs by


class Mutant(NamedTuple):
    """A mistake: the file below the root, the line, what is changed, and its number among those of the file."""

    path: str
    line: int
    what: str
    number: int


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=AS_WRITTEN)
    parser.add_argument("folder")
    parser.add_argument("tests", nargs="*")
    parser.add_argument("--count", type=int, default=500)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--names", action="store_true")
    parser.add_argument("--before")
    asked = parser.parse_args()
    trees = [earlier.ROOT]
    if asked.before:
        trees.insert(0, earlier.check_out(asked.before, "setup-test"))
    missed = [_missed(root, asked) for root in trees]
    return int(missed[-1] > missed[0])


def _missed(root: Path, asked: argparse.Namespace) -> int:
    """Tries the mistakes of a tree and prints how they went; returns how many no test noticed."""
    tests = asked.tests or [f"tests/{asked.folder}"]
    every = list(all_mutants(root, asked.folder))
    chosen = random.Random(asked.seed).sample(every, min(asked.count, len(every)))
    try:
        with tempfile.TemporaryDirectory() as scratch:
            copies = [copy_of(root, Path(scratch) / str(number)) for number in range(asked.jobs)]
            reach = Reach.measured(copies[0], asked.folder, tests)
            outcomes = tried(copies, chosen, reach)
    except TestsFailedError as error:
        raise SystemExit(f"the tests did not run: {error}") from error
    for mutant, outcome in zip(chosen, outcomes, strict=True):
        if asked.names and outcome != NOTICED:
            print(f"{mutant.path}:{mutant.line}: {mutant.what}: {outcome}")
    counts = ", ".join(f"{outcomes.count(outcome)} {outcome}" for outcome in (NOTICED, MISSED, NOT_EXECUTED))
    print(f"{asked.folder}: {len(chosen)} of {len(every)} mistakes, seed {asked.seed}: {counts}")
    return len(outcomes) - outcomes.count(NOTICED)


def all_mutants(root: Path, folder: str) -> Iterator[Mutant]:
    """The mistakes that can be made in the files of a folder, in the order of the files and of their text."""
    for path in sorted((root / folder).rglob("*.py")):
        name = path.relative_to(root).as_posix()
        for number, (line, what, _) in enumerate(_changes(ast.parse(path.read_text()))):
            yield Mutant(name, line, what, number)


class Reach:
    """Which tests execute a line.

    tests    all, as pytest takes them.
    by_line  by file, then line: test functions as pytest takes them; none where a line is executed by importing its file.
    """

    def __init__(self, tests: list[str], by_line: Mapping[str, Mapping[int, list[str]]]) -> None:
        self._tests = tests
        self._by_line = by_line

    @classmethod
    def measured(cls, root: Path, folder: str, tests: list[str]) -> "Reach":
        """By running them. Raises TestsFailedError where one fails without a mistake, or pytest did not run."""
        files = measure(root, [folder], tests, has_contexts=True)["files"]
        reach = cls(tests, {name: {int(line): [test for test in said if test] for line, said in file["contexts"].items()} for name, file in files.items()})  # fmt: skip
        done = run_in(root, ("pytest", "-x", *reach.all))
        if done.returncode:
            raise TestsFailedError((done.stdout + done.stderr)[-2000:])
        return reach

    @property
    def all(self) -> list[str]:
        """The tests that execute any line."""
        return sorted({test for lines in self._by_line.values() for tests in lines.values() for test in tests})

    def of(self, mutant: Mutant) -> list[str]:
        """The tests that may notice it: those of its line, or of its file where importing executes the line; or none."""
        lines = self._by_line.get(mutant.path, {})
        if mutant.line not in lines:
            return []
        return lines[mutant.line] or sorted(set(chain.from_iterable(lines.values()))) or self._tests


def tried(copies: list[Path], mutants: list[Mutant], reach: Reach) -> list[str]:
    """Makes each mistake in a copy of the tree and runs the tests; returns MISSED, NOTICED or NOT_EXECUTED for each."""
    free: SimpleQueue[Path] = SimpleQueue()
    for copy in copies:
        free.put(copy)

    def outcome_of(mutant: Mutant) -> str:
        copy = free.get()
        try:
            return outcome_in(copy, mutant, reach.of(mutant))
        finally:
            free.put(copy)

    with ThreadPoolExecutor(len(copies)) as threads:
        return list(threads.map(outcome_of, mutants))


def outcome_in(root: Path, mutant: Mutant, tests: list[str]) -> str:
    """Makes one mistake in a tree, runs the tests, and takes it back."""
    if not tests:
        return NOT_EXECUTED
    path = root / mutant.path
    right = path.read_text()
    tree = ast.parse(right)
    _, _, change = list(_changes(tree))[mutant.number]
    change()
    path.write_text(ast.unparse(ast.fix_missing_locations(tree)))
    try:
        return NOTICED if run_in(root, ("pytest", "-x", *tests), WAIT_S).returncode else MISSED
    except subprocess.TimeoutExpired:
        return NOTICED
    finally:
        path.write_text(right)


def _changes(tree: ast.Module) -> Iterator[Change]:
    """Each mistake that can be made in a file: the line of its statement, what it is, and what makes it, once."""
    return _changes_within(tree, 0)


def _changes_within(parent: ast.AST, line: int) -> Iterator[Change]:
    docstring = parent.body[0] if _has_docstring(parent) else None  # type: ignore[attr-defined]
    for field, value in ast.iter_fields(parent):
        if field in TYPES:
            continue
        for index, child in enumerate(value if isinstance(value, list) else [value]):
            if not isinstance(child, ast.AST) or child is docstring:
                continue
            here = child.lineno if isinstance(child, ast.stmt) else line
            place = _Place(parent, field, index if isinstance(value, list) else None)
            for what, change in _changes_of(child, place):
                yield here, what, change
            yield from _changes_within(child, here)


class _Place(NamedTuple):
    """Where a node stands in its parent."""

    parent: ast.AST
    field: str
    index: int | None

    def put(self, node: ast.AST) -> None:
        if self.index is None:
            setattr(self.parent, self.field, node)
        else:
            getattr(self.parent, self.field)[self.index] = node


def _has_docstring(node: ast.AST) -> bool:
    return isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(node) is not None


def _changes_of(node: ast.AST, place: _Place) -> Iterator[tuple[str, Callable[[], None]]]:
    def becomes(new: ast.AST) -> Callable[[], None]:
        return lambda: place.put(new)

    match node:
        case ast.Compare(ops=[operator, *others]) if type(operator) in TURNED:
            turned = TURNED[type(operator)]
            new = ast.Compare(node.left, [turned(), *others], node.comparators)  # type: ignore[list-item]
            yield f"{type(operator).__name__} is {turned.__name__}", becomes(new)
        case ast.BoolOp() | ast.BinOp() if type(node.op) in TURNED:
            turned = TURNED[type(node.op)]
            yield f"{type(node.op).__name__} is {turned.__name__}", lambda: setattr(node, "op", turned())
        case ast.UnaryOp(op=ast.Not()):
            yield "not is left out", becomes(node.operand)
        case ast.If() | ast.While() | ast.IfExp():
            turned_test = ast.UnaryOp(ast.Not(), node.test)
            yield "the condition is turned", lambda: setattr(node, "test", turned_test)
        case ast.Constant(value=bool()):
            yield f"{node.value} is {not node.value}", becomes(ast.Constant(not node.value))
        case ast.Constant(value=int()):
            yield f"{node.value!r} is one higher", becomes(ast.Constant(int(str(node.value)) + 1))
        case ast.Constant(value=str() | bytes()) if node.value and not _is_wording(node.value):
            yield f"{node.value[:20]!r} is empty", becomes(ast.Constant(type(node.value)()))
        case ast.Return(value=ast.expr()):
            yield "returns None", becomes(ast.Return(None))
        case ast.Expr(value=ast.Call()):
            yield "the call is left out", becomes(ast.Pass())


def _is_wording(text: str | bytes) -> bool:
    return isinstance(text, str) and " " in text.strip()


if __name__ == "__main__":
    sys.exit(main())
