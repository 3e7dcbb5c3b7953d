"""Lines and branch arcs that tests have executed, as coverage.py has measured them."""

import json
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tests.cover.tree import run_in

FAILED = 1  # pytest: some tests have failed
# Measured, on a busy machine, a test takes several times the two minutes of pyproject.toml, after which pytest ends without
# the measured data.
PATIENCE = ("-o", "faulthandler_timeout=1800")


class TestsFailedError(Exception):
    """Tests could not be run, so that nothing was measured. The text is what pytest has said last."""


def measure(root: Path, folders: Sequence[str], tests: Sequence[str], *, has_contexts: bool = False) -> dict[str, Any]:
    """Runs tests in a tree; returns coverage's report, `files` by path below the root.

    folders       of the product, that are measured.
    tests         files and folders, as pytest takes them.
    has_contexts  whether the report names for each line the test functions that have executed it.

    Raises TestsFailedError where pytest did not run. Tests that fail do not matter here.
    """
    with tempfile.TemporaryDirectory() as scratch:
        settings = Path(scratch) / "settings"
        settings.write_text(
            f"[run]\nbranch = true\ndata_file = {scratch}/data\nsource =\n"
            + "".join(f"    {folder}\n" for folder in folders)
        )
        contexts = ("-p", "contexts") if has_contexts else ()
        done = run_in(root, ("coverage", "run", f"--rcfile={settings}", "-m", "pytest", *PATIENCE, *contexts, *tests))
        if done.returncode not in (0, FAILED) or not (Path(scratch) / "data").exists():
            raise TestsFailedError((done.stdout + done.stderr)[-2000:])
        report = Path(scratch) / "report"
        words = ["coverage", "json", "-q", f"--rcfile={settings}", "-o", str(report)]
        done = run_in(root, [*words, "--show-contexts"] if has_contexts else words)
        if done.returncode:
            raise TestsFailedError((done.stdout + done.stderr)[-2000:])
        return dict(json.loads(report.read_text()))
