"""`captain run` on the simulated board as a process of its own, given trouble from outside, and watched."""

import json
import os
import signal
import socket
import subprocess
import tempfile
import time
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from drivers.sim.radio.control import VARIABLE
from drivers.sim.trouble import BOARD, TROUBLE
from firmware.config import board_file
from tests.proof.chaos.patient import WORKER
from tests.proof.chaos.stage import INTERFACES

ROOT = Path(__file__).parents[3]
PROGRAM = str((ROOT / os.environ.get("CAPTAIN", ".venv/bin/captain")).absolute())
START_S = 20.0
STOP_S = 5.0
ANSWER_S = 3.0  # of the control socket and of the simulated board: both answer within milliseconds
LOOK_S = 0.1  # between two looks at what it says of itself

CONFIGURATION = """
[endpoint]
control = "{folder}/control"
from_users = {from_users}
to_users = {to_users}
pull = {pull}
report = {report}

[interfaces.beside]
driver = "udp"
framing = "pdu"
listen = "127.0.0.1:{beside}"
peers = ["127.0.0.1:{beside_peer}"]
"""


class Ports(NamedTuple):
    """TCP ports of the endpoint; UDP ports of the interface beside and of the simulated radio, with who is there."""

    from_users: int
    to_users: int
    pull: int
    report: int
    beside: int
    beside_peer: int
    radio: int
    radio_peer: int
    radio_control: int


class Sample(NamedTuple):
    """What the process has: resident memory of it and of its children, in kB, and descriptors of it."""

    at_s: float
    memory_kb: int
    children_kb: int
    descriptors: int
    children: int


class StationProcess:
    """A patient.Theatre. folder is short: paths of Unix sockets have at most 107 octets."""

    def __init__(self, ports: Ports) -> None:
        self.ports = ports
        self._temporary = tempfile.TemporaryDirectory(prefix="chaos-")
        self.folder = Path(self._temporary.name)
        self.hardware = board_file.load("sim")
        self._status: dict[str, Any] = {}
        self._looked = float("-inf")
        self._voice = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._voice.bind(str(self.folder / "voice"))
        self._voice.settimeout(ANSWER_S)
        self.slowest_answer_s = 0.0

    def start(self) -> None:
        """Start it, and wait until it answers."""
        ports = self.ports
        board = self.folder / "board.toml"
        # Its radio is in the air of the run's own messages, without neighbours.
        board.write_text((board_file.BOARDS / "sim.toml").read_text().partition("[neighbours]")[0])
        (self.folder / "captain.toml").write_text(CONFIGURATION.format(folder=self.folder, **ports._asdict()))
        radio = f"listen=127.0.0.1:{ports.radio} peers=127.0.0.1:{ports.radio_peer}"
        surroundings = {"TMPDIR": str(self.folder), VARIABLE: f"{radio} control=127.0.0.1:{ports.radio_control}"}
        with (self.folder / "journal").open("wb") as journal:
            self.child = subprocess.Popen(
                [PROGRAM, "run", "--board", str(board), "--config", str(self.folder / "captain.toml")],
                stdin=subprocess.DEVNULL,
                stdout=journal,
                stderr=journal,
                env=os.environ | surroundings,
            )
        end = time.monotonic() + START_S
        while not self._answers():
            if time.monotonic() > end or self.child.poll() is not None:
                raise RuntimeError(f"the station does not start:\n{self.journal()}")
            time.sleep(LOOK_S)

    def stop(self) -> int:
        """End it as a service manager does; its exit code."""
        self.child.send_signal(signal.SIGTERM)
        try:
            return self.child.wait(STOP_S)
        except subprocess.TimeoutExpired:
            self.child.kill()
            return self.child.wait()

    def close(self) -> None:
        """Whatever has happened before; idempotent."""
        if self.child.poll() is None:
            self.child.kill()
            self.child.wait()
        self._voice.close()
        self._temporary.cleanup()

    def ask(self, **question: object) -> dict[str, Any]:
        """One question and its answer over the control socket. Raises OSError where there is none."""
        began = time.monotonic()
        with socket.socket(socket.AF_UNIX) as line:
            line.settimeout(ANSWER_S)
            line.connect(str(self.folder / "control"))
            line.sendall(json.dumps(question).encode() + b"\n")
            with line.makefile("rb") as answers:
                answer: dict[str, Any] = json.loads(answers.readline())
        self.slowest_answer_s = max(self.slowest_answer_s, time.monotonic() - began)
        return answer

    def journal(self) -> str:
        return (self.folder / "journal").read_text(errors="replace")

    def sample(self) -> Sample:
        pid, children = self.child.pid, self._children()
        descriptors = len(os.listdir(f"/proc/{pid}/fd"))
        return Sample(time.monotonic(), _memory_kb(pid), sum(map(_memory_kb, children)), descriptors, len(children))

    # patient.Theatre

    def now(self) -> float:
        return time.monotonic()

    def obey(self, text: str) -> None:
        if text.endswith(WORKER):
            if text.startswith("begin"):
                self._kill_worker()
            return
        (door,) = self.folder.glob(f"captain-sim-*/{TROUBLE}")
        self._voice.sendto(text.encode(), str(door))
        answer = self._voice.recv(1000).decode()
        if answer != "ok":
            raise RuntimeError(answer)

    def is_up(self, name: str) -> bool:
        status = self._look()
        board: Mapping[str, Any] = status["board"]
        if name == BOARD:
            return bool(board["worker"]["is_up"]) and not board["complaints"]
        is_running: bool = board["slots"][name]["state"] == "running"
        return is_running and status["interfaces"][INTERFACES[name]]["state"] == "up"

    def is_in_fault(self, name: str) -> bool:
        return name != BOARD and bool(self._look()["board"]["slots"][name]["state"] == "fault")

    def _children(self) -> list[int]:
        pid = self.child.pid
        return [int(text) for text in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]

    def _kill_worker(self) -> None:
        for pid in self._children():
            with suppress(OSError):  # it has just ended
                if b"sim-board" in Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0"):
                    os.kill(pid, signal.SIGKILL)

    def _answers(self) -> bool:
        try:
            self.ask(do="status")
        except OSError:
            return False
        return True

    def _look(self) -> dict[str, Any]:
        """The status, no older than LOOK_S."""
        if time.monotonic() - self._looked > LOOK_S:
            self._status = self.ask(do="status")["status"]
            self._looked = time.monotonic()
        return self._status


def _memory_kb(pid: int) -> int:
    try:
        lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    except OSError:  # it has just ended
        return 0
    return next((int(line.split()[1]) for line in lines if line.startswith("VmRSS:")), 0)
