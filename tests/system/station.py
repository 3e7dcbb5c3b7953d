"""Station as a process of the installed program: ports, signals, exit code."""

import json
import os
import signal
import socket
import subprocess
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from tests.reference.topics import undocumented
from tests.system.ports import Ports

ROOT = Path(__file__).parents[2]
PROGRAM = [str((ROOT / os.environ.get("CAPTAIN", ".venv/bin/captain")).absolute())]

# Timeout in seconds, which only a failing test reaches.
PATIENCE = 15.0
BETWEEN = 0.005  # pause in seconds between two questions
START = 10.0
ENDPOINTS = ("from_users", "to_users", "pull", "report")

Table = Mapping[str, Any]


def toml(value: Any) -> str:
    """Return a value in TOML: the same as JSON, except for tables."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {toml(item)}" for key, item in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(toml(item) for item in value) + "]"
    return json.dumps(value)


def toml_table(name: str, table: Table) -> str:
    return f"[{name}]\n" + "".join(f"{key} = {toml(value)}\n" for key, value in table.items())


class Station:
    """Process `captain run` with four consecutive ports of its own. Control socket and configuration are in `folder`."""

    def __init__(self, folder: Path, ports: Ports) -> None:
        self.folder = folder
        self.ports = dict(zip(ENDPOINTS, ports.take_row(len(ENDPOINTS)), strict=True))
        self.control = folder / "control.sock"
        self.file = folder / "captain.toml"
        self.stderr = folder / "stderr"
        self.child: subprocess.Popen[bytes] | None = None
        self._is_told_to_end = False

    def address(self, endpoint: str) -> str:
        return f"tcp://127.0.0.1:{self.ports[endpoint]}"

    def configure(self, interfaces: Mapping[str, Table], more: str = "", **tables: Table) -> None:
        """Write captain.toml with interfaces, further tables by name, and the text `more`."""
        endpoint = dict(self.ports) | {"control": str(self.control)} | dict(tables.pop("endpoint", {}))
        identity = {"mac": "02:00:00:00:00:aa"} | dict(tables.pop("station", {}))
        parts = [toml_table("station", identity), toml_table("endpoint", endpoint)]
        parts += [toml_table(name, table) for name, table in tables.items()]
        parts += [toml_table(f"interfaces.{name}", table) for name, table in interfaces.items()]
        self.file.write_text("\n".join([*parts, more]))

    def start(self, *arguments: str) -> None:
        """Start the station and wait until it reports readiness, as a service manager does."""
        self._is_told_to_end = False
        with _Readiness(self.folder / "notify.sock") as readiness, self.stderr.open("wb") as stderr:
            self.child = subprocess.Popen(
                [*PROGRAM, "run", "--config", str(self.file), "--board", "none", *arguments],
                stdin=subprocess.DEVNULL,
                stdout=stderr,
                stderr=stderr,
                env=os.environ | {"NOTIFY_SOCKET": readiness.path},
                cwd=self.folder,
            )
            assert readiness.is_reached(lambda: self.running), f"it did not start: {self.stderr.read_text()}"

    @property
    def running(self) -> bool:
        return self.child is not None and self.child.poll() is None

    def signal(self, number: int) -> None:
        assert self.child is not None
        self._is_told_to_end = number == signal.SIGTERM
        self.child.send_signal(number)

    def stop(self) -> None:
        """Stop the station as a service manager does. Check that it ends at once, with exit code 0 and no traceback."""
        if self.child is None:
            return
        if self.running and not self._is_told_to_end:
            self.signal(signal.SIGTERM)
        child, self.child = self.child, None
        try:
            code = child.wait(timeout=PATIENCE)
        except subprocess.TimeoutExpired:
            child.kill()
            child.wait()
            raise AssertionError("it did not stop on SIGTERM") from None
        said = self.stderr.read_text(errors="replace")
        assert "Traceback" not in said, said
        assert code == 0, f"exit code {code}: {said}"

    def kill(self) -> None:
        """Kill the station in any state, for a test that has already failed."""
        if self.child is not None:
            self.child.kill()
            self.child.wait()
            self.child = None

    def ask(self, **question: Any) -> dict[str, Any]:
        """Ask one question over the control socket and return the answer."""
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as line:
            line.settimeout(PATIENCE)
            line.connect(str(self.control))
            line.sendall(json.dumps(question).encode() + b"\n")
            with line.makefile("rb") as answers:
                answer: dict[str, Any] = json.loads(answers.readline())
        return answer

    def status(self) -> dict[str, Any]:
        answer = self.ask(do="status")
        assert answer["ok"], answer
        status: dict[str, Any] = answer["status"]
        assert undocumented("status", status) == []
        return status

    def drops(self) -> dict[tuple[str, str], int]:
        """Return the counts of drops since the start, by place and reason."""
        return {(row["where"], row["reason"]): row["count"] for row in self.status()["drops"]}

    def until(self, holds: Callable[[dict[str, Any]], bool], patience: float = PATIENCE) -> dict[str, Any]:
        """Ask for the status until holds() returns True for it, and return it. Pause between the questions."""
        end = time.monotonic() + patience
        while True:
            status = self.status()
            if holds(status):
                return status
            assert time.monotonic() < end, f"it never came to hold: {json.dumps(status, indent=1)}"
            time.sleep(BETWEEN)


class _Readiness:
    """Service manager's end of sd_notify."""

    def __init__(self, path: Path) -> None:
        self.path = str(path)
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)

    def __enter__(self) -> "_Readiness":
        Path(self.path).unlink(missing_ok=True)
        self._socket.bind(self.path)
        self._socket.settimeout(0.1)
        return self

    def __exit__(self, *_: object) -> None:
        self._socket.close()

    def is_reached(self, is_alive: Callable[[], bool]) -> bool:
        end = time.monotonic() + START
        while is_alive() and time.monotonic() < end:
            try:
                if b"READY=1" in self._socket.recv(4096).split(b"\n"):
                    return True
            except TimeoutError:
                continue
        return False
