"""Trees of this project that tests run in: clones, and copies that may be changed."""

import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

LEFT_OUT = (".git", ".venv", "build", "__pycache__", ".mypy_cache", ".ruff_cache", ".hypothesis")
WAIT_S = 7200  # all tests in one process, measured, beside other work; pytest itself ends a test that does not


def copy_of(root: Path, place: Path) -> Path:
    """Copies the files of a tree to a new folder, with a link to its build."""
    shutil.copytree(root, place, ignore=shutil.ignore_patterns(*LEFT_OUT), symlinks=True)
    (place / "build").symlink_to(root / "build")
    return place


def run_in(root: Path, words: Sequence[str], wait_s: float = WAIT_S) -> subprocess.CompletedProcess[str]:
    """Runs `python -m WORDS...` in a tree, with this environment's packages and the tree's own modules, client and codec.

    Raises subprocess.TimeoutExpired after wait_s seconds.
    """
    here = Path(__file__).parent  # has contexts.py, which an old tree lacks
    path = f"{root}:{root / 'firmware/captain_client'}:{root / 'build/codec/python'}:{here}"
    environment = dict(os.environ, PYTHONPATH=path, PYTHONDONTWRITEBYTECODE="1")
    return subprocess.run(
        [sys.executable, "-m", *words],
        check=False,
        cwd=root,
        env=environment,
        capture_output=True,
        text=True,
        timeout=wait_s,
    )
