"""README's lesson: own message is changed, decoded at the other station, recorded."""

import subprocess
import sys
from pathlib import Path

from firmware.lab.demo_user import MAC
from tests.system.lesson import BLOCKS
from tests.system.station import ROOT

PROGRAM_LINES = 15
RECORDED = 40  # frames, of which about 13 are the own ones: 10 of 32 per second


def test_lesson_word_for_word_shows_the_own_message_at_the_other_station(tmp_path: Path) -> None:
    command = ["unshare", "-Urn", sys.executable, "-m", "tests.system.lesson", str(tmp_path)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    shown = [line for line in done.stdout.splitlines() if "CAM" in line]
    assert 5 <= len(shown) < RECORDED, done.stdout
    assert all(MAC["A"] in line for line in shown), done.stdout


def test_lesson_program_is_short() -> None:
    assert len([line for line in BLOCKS["python"].splitlines() if line.strip()]) <= PROGRAM_LINES


def test_readme_is_short_enough_to_read() -> None:
    text = (ROOT / "README.md").read_text()
    assert len(text.splitlines()) <= 200
    assert len(text.encode()) <= 12_000
