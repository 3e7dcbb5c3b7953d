"""README's lesson: its commands and programs, run word for word, in a network namespace of this process.

usage: unshare -Urn python -m tests.system.lesson FOLDER

FOLDER  an empty one, for the files of the lesson.

The ports are the default ones, which a namespace has for itself. Prints what tshark has printed.
"""

import os
import re
import signal
import subprocess
import sys
from pathlib import Path

from tests.expect import Expect
from tests.system.station import ROOT

LESSON = (ROOT / "README.md").read_text().partition("\n## Lesson")[2].partition("\n## ")[0]
BLOCKS = dict(re.findall(r"^```(.+?)\n(.*?)^```", LESSON, re.MULTILINE | re.DOTALL))
END = "end of block"
SET_UP = 60.0  # seconds for make to find that all is set up, on a busy machine; reached only by a test that fails


class Shell:
    """Terminal 2: one bash for all blocks, since they share variables and jobs."""

    def __init__(self, folder: Path) -> None:
        self._child = subprocess.Popen(
            ["bash"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, cwd=folder, text=True, start_new_session=True
        )

    def run(self, block: str) -> str:
        """Run the lines of a block; return what they print."""
        assert self._child.stdin is not None
        assert self._child.stdout is not None
        self._child.stdin.write(f"{block}\necho {END}\n")
        self._child.stdin.flush()
        return "".join(iter(self._child.stdout.readline, f"{END}\n"))

    def end(self) -> None:
        os.killpg(self._child.pid, signal.SIGKILL)
        self._child.wait()


def row(text: str) -> str:
    """Return a pattern for a row of the screen, in which count, rate and age differ."""
    sender, kind, station, _, _, _, says = re.split(r"  +", text.strip(), maxsplit=6)
    return rf"{sender} +{kind} +{station} .* s +{re.escape(says)}.*"


def main(folder: Path) -> None:
    subprocess.run(["ip", "link", "set", "lo", "up"], check=True)
    (folder / ".venv").symlink_to(ROOT / ".venv")
    (folder / "lesson.py").write_text(BLOCKS["python"])
    shell = Shell(folder)
    try:
        with Expect(["sh", "-c", BLOCKS["sh terminal 1"]], {"TERM": "xterm"}) as terminal:
            terminal.until_line("received by B's user.*", SET_UP)
            for step in ("send", "change"):
                shell.run(BLOCKS[f"sh {step}"])
                terminal.until_line(row(BLOCKS[f"text {step}"]))
            print(shell.run(BLOCKS["sh record"]))
            terminal.type(b"\x03")
            terminal.until_line("B received .* from A's user.*")
            terminal.ended()
    finally:
        shell.end()


if __name__ == "__main__":
    main(Path(sys.argv[1]))
