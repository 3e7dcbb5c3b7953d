"""In the guest: does what the bench asks for, a line of JSON each, and says what its programs say.

Asked by {"do": WORD, ...} for: clocks; pulse, the kernel's last; step, the system's clock by ns; write, a file; start, a program; run, one that
ends soon; stop, a program. Says {"answer": ...} to each, in their order, and by itself {"program": NAME, "line": TEXT}
for each line of a program, and {"program": NAME, "ended": STATUS}.
"""

import json
import os
import selectors
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from pps.pulse import Clocks, read_clocks

BATCH = 65_536
CLOCKS = b'{"do": "clocks"}\n'
EXACT_NS = 200_000  # of a step
RUN_S = 55.0  # of a program that is waited for


class Agent:
    """At one port, with the programs that it has started."""

    def __init__(self, port: str) -> None:
        self._port = os.open(port, os.O_RDWR)
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._port, selectors.EVENT_READ, self._hear)
        self._programs: dict[str, subprocess.Popen[bytes]] = {}
        self._heard = b""
        self._doings: dict[str, Callable[..., object]] = {
            "clocks": read_clocks,
            "pulse": self._pulse,
            "step": self._step,
            "write": self._write,
            "start": self._start,
            "run": self._run,
            "stop": lambda name: self._programs[name].terminate(),
        }

    def serve(self) -> None:
        """For ever: the bench takes the power away."""
        self._say({"answer": sys.version})
        while True:
            for key, _ in self._selector.select():
                key.data()

    def _hear(self) -> None:
        octets = os.read(self._port, BATCH)
        if octets == CLOCKS and not self._heard:  # the shortest way, for its length is what is not known
            now = read_clocks()
            os.write(self._port, b'{"answer": [%d, %d, %r]}\n' % now)
            return
        *lines, self._heard = (self._heard + octets).split(b"\n")
        for line in lines:
            asked = json.loads(line)
            do = self._doings[asked.pop("do")]
            try:
                self._say({"answer": do(**asked)})
            except (OSError, subprocess.SubprocessError) as error:
                self._say({"answer": None, "error": str(error)})

    def _pulse(self) -> tuple[str, Clocks]:
        """The last pulse as the kernel has it, and the clocks of now."""
        return Path("/sys/class/pps/pps0/assert").read_text(), read_clocks()

    def _step(self, ns: int) -> None:
        """By the oscillator, which no step moves: again until it is so, for the machine may be busy in between."""
        wanted = _ahead_ns() + ns
        while abs(short_ns := wanted - _ahead_ns()) > EXACT_NS:
            time.clock_settime_ns(time.CLOCK_REALTIME, time.time_ns() + short_ns)

    def _write(self, path: str, text: str) -> None:
        Path(path).write_text(text)

    def _start(self, name: str, words: Sequence[str]) -> None:
        program = subprocess.Popen(words, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        self._programs[name] = program
        assert program.stdout is not None
        out = program.stdout.fileno()
        self._selector.register(out, selectors.EVENT_READ, lambda: self._pass_on(name, program, out))

    def _pass_on(self, name: str, program: "subprocess.Popen[bytes]", out: int) -> None:
        # Whole lines: each program says one at once, and shorter ones than a pipe takes in one piece.
        octets = os.read(out, BATCH)
        for line in octets.decode(errors="replace").splitlines():
            self._say({"program": name, "line": line})
        if not octets:
            self._selector.unregister(out)
            self._say({"program": name, "ended": program.wait()})

    def _run(self, words: Sequence[str]) -> str:
        ran = subprocess.run(
            words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=RUN_S, check=False
        )
        return ran.stdout

    def _say(self, what: dict[str, Any]) -> None:
        octets = json.dumps(what).encode() + b"\n"
        while octets:
            octets = octets[os.write(self._port, octets) :]


def _ahead_ns() -> int:
    """The system's clock less the oscillator."""
    now = read_clocks()
    return now.system_ns - now.raw_ns


if __name__ == "__main__":
    Agent(sys.argv[1]).serve()
