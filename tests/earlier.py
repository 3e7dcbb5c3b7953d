"""Earlier commit of this project, checked out and set up next to this tree."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
TREE = ROOT / "build" / "bench" / "before"


def check_out(commit: str, *targets: str) -> Path:
    """Check a commit out, make targets of its Makefile and return its root. Another commit there is replaced.

    Raises SystemExit with the command if git or make fails.
    """
    if not TREE.exists():
        _run("git", "clone", "--quiet", "--no-checkout", str(ROOT), str(TREE))
    _run("git", "-C", str(TREE), "fetch", "--quiet", "origin")
    _run("git", "-C", str(TREE), "checkout", "--quiet", "--force", "--detach", commit)
    _run("make", "-C", str(TREE), *targets)
    return TREE


def _run(*command: str) -> None:
    if subprocess.run(command, stdout=sys.stderr, check=False).returncode:
        raise SystemExit(f"{' '.join(command)} has failed")
