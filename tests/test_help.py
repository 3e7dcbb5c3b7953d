"""Help of make: the targets by group on one screen, all of them on request."""

import re
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
MAKEFILE = (ROOT / "Makefile").read_text()


def make(*argv: str) -> list[str]:
    ended = subprocess.run(["make", "-s", *argv], cwd=ROOT, capture_output=True, text=True, timeout=20, check=True)
    return ended.stdout.splitlines()


def test_make_without_a_target_fits_a_screen_and_names_existing_targets() -> None:
    lines = make()
    assert len(lines) < 24
    assert max(map(len, lines)) < 80
    targets = {line.split()[0] for line in lines if line.startswith("  ")}
    assert {"setup", "run", "test", "check"} < targets <= set(re.findall(r"^([a-z0-9-]+):", MAKEFILE, re.MULTILINE))


def test_make_help_of_all_shows_each_target_once_within_80_columns() -> None:
    lines = make("help", "ALL=1")
    assert max(map(len, lines)) < 80
    shown = [line.split()[0] for line in lines if re.match(r"  [a-z]", line)]
    assert sorted(shown) == sorted(re.findall(r"^([a-z0-9-]+):.*## ", MAKEFILE, re.MULTILINE))
