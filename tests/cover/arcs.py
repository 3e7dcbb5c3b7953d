"""Prints the branches that the tests take, beside an earlier commit.

usage: python -m tests.cover.arcs [--names] [--tests PATH ...] COMMIT; make arcs BEFORE=COMMIT

COMMIT   an earlier one, which is checked out and set up in build/bench/before. Its report is kept in build/cover, because
         its tests take as long as those of this tree: half an hour.
--names  prints the branches that were taken before and are not now, though they are still there.
--tests  files and folders of tests. Default: all that run in this process; tests/system starts stations.

A branch is known by its function and the texts of the lines that it leads from and to. So it may move in its top
folder. It is lost if it was taken before, is still in the code and is not taken any more; the exit code is then 1.

It is gone if it was taken before and is not in the code. Then its line changed, or its function was renamed, removed
or moved to another top folder. It never counts as lost then, whatever the tests take of the code in its place.
"""

import argparse
import ast
import hashlib
import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from tests import earlier
from tests.cover.measured import TestsFailedError, measure
from tests.structure import OURS

IN_PROCESS = ("tests", "--ignore=tests/system")
AS_WRITTEN = argparse.RawDescriptionHelpFormatter


class Arc(NamedTuple):
    """A branch: function or "", the text of the line that decides, and that of the line it leads to or "exit"."""

    function: str
    before: str
    after: str


class Arcs(NamedTuple):
    """Those of one folder: taken by tests, and all."""

    taken: frozenset[Arc]
    all: frozenset[Arc]

    def lost(self, now: "Arcs") -> frozenset[Arc]:
        """Branches that were taken, are in the code of now, and are not taken there."""
        return (self.taken & now.all) - now.taken

    def gone(self, now: "Arcs") -> frozenset[Arc]:
        """Branches that were taken, and are not in the code of now."""
        return self.taken - now.all


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=AS_WRITTEN)
    parser.add_argument("commit")
    parser.add_argument("--names", action="store_true")
    parser.add_argument("--tests", nargs="+", default=IN_PROCESS)
    asked = parser.parse_args()
    try:
        before = folders_of(earlier.check_out(asked.commit, "setup-test"), report_of(asked.commit, asked.tests))
        now = folders_of(earlier.ROOT, measure(earlier.ROOT, OURS, asked.tests))
    except TestsFailedError as error:
        print(f"the tests did not run: {error}", file=sys.stderr)
        return 2
    print(f"{'folder':24}{'arcs taken before':>20}{'of':>8}{'taken now':>12}{'of':>8}{'gone':>8}{'lost (goal 0)':>16}")
    lost_of_all = 0
    for folder in sorted({*before, *now}):
        old, new = before.get(folder, NONE), now.get(folder, NONE)
        lost, gone = old.lost(new), len(old.gone(new))
        lost_of_all += len(lost)
        print(
            f"{folder:24}{len(old.taken):20}{len(old.all):8}{len(new.taken):12}{len(new.all):8}{gone:8}{len(lost):16}"
        )
        for arc in sorted(lost) if asked.names else ():
            print(f"    {arc.function}: {arc.before} -> {arc.after}")
    return int(lost_of_all > 0)


NONE = Arcs(frozenset(), frozenset())


def report_of(commit: str, tests: Sequence[str]) -> dict[str, Any]:
    """Return coverage's report on an earlier commit, from build/cover if it was measured before.

    Raises TestsFailedError where its tests did not run.
    """
    words = ["git", "-C", str(earlier.TREE), "rev-parse", "HEAD"]
    measured = subprocess.run(words, capture_output=True, text=True, check=True).stdout + " ".join(tests)
    kept = earlier.ROOT / "build/cover" / f"{commit}-{hashlib.sha256(measured.encode()).hexdigest()[:8]}.json"
    if not kept.exists():
        report = measure(earlier.TREE, OURS, tests)
        kept.parent.mkdir(parents=True, exist_ok=True)
        kept.write_text(json.dumps(report))
    return dict(json.loads(kept.read_text()))


def folders_of(root: Path, report: dict[str, Any]) -> dict[str, Arcs]:
    """Return the arcs of a tree by top folder, by coverage's report."""
    found: dict[str, tuple[set[Arc], set[Arc]]] = {}
    for name, file in report["files"].items():
        taken, every = found.setdefault(name.split("/")[0], (set(), set()))
        source = Source((root / name).read_text())
        taken.update(map(source.arc, file["executed_branches"]))
        every.update(map(source.arc, file["executed_branches"] + file["missing_branches"]))
    return {folder: Arcs(frozenset(taken), frozenset(every)) for folder, (taken, every) in found.items()}


class Source:
    """A file's text, and the functions its lines are in."""

    def __init__(self, text: str) -> None:
        self._lines = text.splitlines()
        self._names: dict[int, str] = {}
        self._walk(ast.parse(text), "")

    def arc(self, lines: list[int]) -> Arc:
        """The branch between two lines, counted from 1; one that leaves the function has a negative second."""
        before, after = lines
        return Arc(self._names.get(before, ""), self._text(before), self._text(after) if after > 0 else "exit")

    def _text(self, line: int) -> str:
        return self._lines[line - 1].strip()

    def _walk(self, node: ast.AST, within: str) -> None:
        for child in ast.iter_child_nodes(node):
            name = within
            if isinstance(child, ast.FunctionDef | ast.ClassDef):
                name = f"{within}.{child.name}".lstrip(".")
                self._names.update(dict.fromkeys(range(child.lineno, (child.end_lineno or child.lineno) + 1), name))
            self._walk(child, name)


if __name__ == "__main__":
    sys.exit(main())
