"""An update that is left by Ctrl-C at a terminal, as soon as the service writes a slot."""

import re
import subprocess
import threading
from typing import NamedTuple

from tests.proof.image.login import Key, words
from tests.proof.image.machine import Guest, NotSeenError

CTRL_C = b"\x03"
WRITING = re.compile(r"(\d+) % +Copying image")  # RAUC's words, as captain update says them
LIMIT_S = 900.0


class Left(NamedTuple):
    """percent: what the service told last. code: of the command. last: its last line."""

    percent: int
    code: int
    last: str


def left(guest: Guest, key: Key, command: str) -> Left:
    """A command of operator by ssh, at a terminal of its own. Raises NotSeenError: it came to its end before."""
    running = subprocess.Popen(
        words(guest, key.path, command, "-tt"), stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1
    )
    assert running.stdin is not None
    assert running.stdout is not None
    limit = threading.Timer(LIMIT_S, running.kill)
    limit.start()
    lines, percent = [], -1
    with running:
        for line in running.stdout:
            lines.append(line.strip())
            if percent < 0 and (found := WRITING.search(line)):
                percent = int(found[1])
                running.stdin.write(CTRL_C.decode())
                running.stdin.flush()
    limit.cancel()
    if percent < 0:
        raise NotSeenError(f"{command}: no slot was written: {' / '.join(lines[-3:])}")
    return Left(percent, running.returncode, next((line for line in reversed(lines) if line), ""))
