"""Subject of a benchmark: forwarder or station, as a process on free ports."""

import json
import os
import socket
import subprocess
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple, Self

from tests.bench import programs
from tests.system.ports import Ports as Held

START_S = 10.0
STOP_S = 3.0
SOURCE = str(programs.ROOT / ".venv" / "bin" / "captain")
BINARY = str(programs.ROOT / "build" / "binary" / "captain-dir" / "captain")

# The second interface never receives a thing: with it the copies of a PDU have to be looked for.
CONFIGURATION = """
[endpoint]
from_users = {from_users}
to_users = {to_users}
pull = {pull}
report = {report}
control = "{control}"

[interfaces.bench]
driver = "udp"
framing = "{framing}"
listen = "127.0.0.1:{listen}"
peers = ["127.0.0.1:{peer}"]

[interfaces.idle]
driver = "udp"
framing = "{framing}"
listen = "127.0.0.1:{idle}"
"""


class Ports(NamedTuple):
    """TCP ports of the endpoint, UDP ports of the interface: where it listens, and where its peer does."""

    from_users: int
    to_users: int
    pull: int
    report: int
    listen: int
    peer: int
    idle: int


def free_ports() -> Ports:
    """Ports that nobody has now; two runs at the same time get different ones."""
    held = Held()
    try:
        return Ports(*(held.take() for _ in Ports._fields))
    finally:
        held.release()


class Subject:
    """A process that forwards; a context manager that starts it, waits until it listens, and ends it."""

    name = "floor"

    def __init__(self) -> None:
        self.ports = self.find_ports()

    def find_ports(self) -> Ports:
        return free_ports()

    def command(self) -> Sequence[str]:
        ports = self.ports
        return [programs.path("floor"), *map(str, (ports.from_users, ports.to_users, ports.listen, ports.peer))]

    def __enter__(self) -> Self:
        self._errors = tempfile.TemporaryFile()
        self.process = subprocess.Popen(self.command(), stdout=subprocess.DEVNULL, stderr=self._errors)
        self._wait()
        return self

    def __exit__(self, *_: object) -> None:
        self.process.terminate()
        try:
            self.process.wait(STOP_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        self._errors.close()

    def cpu_s(self) -> float:
        """Processor time of all threads so far, from the scheduler: nanoseconds, where stat has 10 ms."""
        tasks = Path(f"/proc/{self.process.pid}/task")
        return sum(int((task / "schedstat").read_text().split()[0]) for task in tasks.iterdir()) / 1e9

    def memory_kb(self) -> int:
        """Resident set: VmRSS."""
        for line in Path(f"/proc/{self.process.pid}/status").read_text().splitlines():
            if line.startswith("VmRSS:"):
                return int(line.split()[1])
        raise RuntimeError("no VmRSS")

    def _wait(self) -> None:
        end = time.monotonic() + START_S
        while time.monotonic() < end and self.process.poll() is None:
            with socket.socket() as probe:
                if probe.connect_ex(("127.0.0.1", self.ports.from_users)) == 0:
                    return
            time.sleep(0.01)
        self._errors.seek(0)
        errors = self._errors.read().decode(errors="replace")[-2000:]
        self.__exit__()
        raise RuntimeError(f"{self.name} does not listen at {self.ports.from_users}:\n{errors}")


class Station(Subject):
    """`captain run` with two udp interfaces, all stages and counters on. more: the rest of its configuration."""

    def __init__(self, framing: str = "pdu", captain: str = SOURCE, more: str = "") -> None:
        super().__init__()
        self.name = "station"
        self._captain = captain
        programs.BUILD.mkdir(parents=True, exist_ok=True)
        stem = programs.BUILD / f"station-{os.getpid()}-{self.ports.from_users}"
        self._file = stem.with_suffix(".toml")
        # A path of a Unix socket has at most 107 octets.
        self._control = Path(tempfile.gettempdir()) / f"bench-{os.getpid()}-{self.ports.from_users}.sock"
        words = {"framing": framing, "control": self._control, **self.ports._asdict()}
        self._file.write_text(CONFIGURATION.format(**words) + more)

    def command(self) -> Sequence[str]:
        return [self._captain, "run", "--board", "none", "--config", str(self._file)]

    def __exit__(self, *_: object) -> None:
        super().__exit__()
        self._file.unlink(missing_ok=True)
        self._control.unlink(missing_ok=True)

    def status(self) -> dict[str, Any]:
        """The status object, as the control socket tells it now."""
        with self.control() as control:
            control.sendall(b'{"do": "status"}\n')
            line = control.makefile("rb").readline()
        status: dict[str, Any] = json.loads(line)["status"]
        return status

    def control(self) -> socket.socket:
        """A connection to the control socket."""
        control = socket.socket(socket.AF_UNIX)
        control.settimeout(STOP_S)
        control.connect(str(self._control))
        return control
