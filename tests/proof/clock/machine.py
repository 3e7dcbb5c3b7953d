"""A guest: QEMU's arm64 machine on the bench's loop, with an agent in it that does what it is asked for."""

import json
import os
import signal
import socket
import subprocess
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from board.runtime.child import die_with_parent
from board.runtime.loop import Loop
from pps.chrony.configuration import configuration
from pps.pulse import Clocks, Pulse, pulse_at
from tests.proof.clock.files import BOARD, captain
from tests.proof.clock.truth import Ruler, host_ns

PROJECT = Path(__file__).resolve().parents[3]
MADE = PROJECT / "build/clock"
COMPILED = MADE / "compiled"  # what the guest's Python has made of the sources, kept for the next one
BATCH = 65_536

Answered = Callable[[Any], None]


class LateError(Exception):
    """What was waited for did not come within its limit."""


class Kind(Protocol):
    """What a guest is made of.

    boot_s  until its agent answers, at most. lead_s: from power until its clock has settled, for sure.
    python  the words that a program of the bench is started with.
    """

    @property
    def boot_s(self) -> float: ...
    @property
    def lead_s(self) -> int: ...
    @property
    def python(self) -> Sequence[str]: ...

    def words(self, folder: Path, name: str, date: str, console: Path) -> list[str]:
        """Of QEMU's command line. console: the file that keeps what it says."""

    def has_power(self, folder: Path, name: str) -> None:
        """Called once it has."""

    def receiver(self, path: str) -> list[str]:
        """The same, for a receiver at a tty of this machine."""

    def hold(self, guest: "Guest") -> None:
        """See to it that no station and no chronyd runs."""

    def start(self, guest: "Guest", name: str, interfaces: str) -> None:
        """Start both. interfaces: of captain.toml, beside the receiver."""


@dataclass(frozen=True)
class Made:
    """The bench's own: a small Linux, in which the station runs from its sources.

    root  a directory, or the image of an ext4 file system; it has Python, chronyd and, for captain from its sources,
          the locked packages. initrd: .ci/clock's, with modules of this kernel.
    """

    kernel: Path = MADE / "vmlinuz"
    initrd: Path = MADE / "initrd"
    device_tree: Path = MADE / "pps.dtb"
    root: Path = MADE / "root"

    @property
    def boot_s(self) -> float:
        return 120.0  # 6 s on a quiet machine

    @property
    def lead_s(self) -> int:
        return 150

    @property
    def python(self) -> Sequence[str]:
        return ("python3",)

    def words(self, folder: Path, name: str, date: str, console: Path) -> list[str]:
        shares = {"bench": PROJECT} | ({"root": self.root} if self.root.is_dir() else {})
        drive = ["-drive", f"file={self.root},format=raw,if=virtio,snapshot=on"] if self.root.is_file() else []
        given = ["console=ttyAMA0", "quiet", "panic=-1", f"ROOT={'/dev/vda' if drive else ''}"]
        words = [
            *("-M", "virt,acpi=off", "-cpu", "cortex-a72", "-smp", "1", "-m", "1024", "-accel", "tcg,thread=multi"),
            *("-dtb", str(self.device_tree), "-kernel", str(self.kernel), "-initrd", str(self.initrd)),
            *("-append", " ".join(given), "-serial", f"file:{console}", "-rtc", f"base={date}"),
            *drive,
        ]
        for tag, path in shares.items():
            words += ["-virtfs", f"local,path={path},mount_tag={tag},security_model=none,readonly=on,multidevs=remap"]
        return [*words, "-virtfs", f"local,path={COMPILED},mount_tag=compiled,security_model=none"]

    def has_power(self, folder: Path, name: str) -> None:
        """It asks nobody."""

    def receiver(self, path: str) -> list[str]:
        return ["-chardev", f"serial,id=gnss,path={path}", "-device", "virtconsole,chardev=gnss"]

    def hold(self, guest: "Guest") -> None:
        """None of them does yet."""

    def start(self, guest: "Guest", name: str, interfaces: str) -> None:
        guest.write("/run/chrony.conf", configuration())
        guest.write("/run/board.toml", BOARD)
        guest.write("/run/captain.toml", captain(name, 'port = "/dev/hvc0"', interfaces))
        guest.start("chronyd", "chronyd", "-d", "-u", "root", "-f", "/run/chrony.conf")
        files = ("--config", "/run/captain.toml", "--board", "/run/board.toml")
        guest.start("captain", *self.python, "-m", "firmware", "run", *files)


class Guest:
    """A running guest.

    monitor      path of its QMP socket.
    ruler        lays its oscillator on the host's clock; clocks() feeds it.
    told         by name: what is called with each line of a program in it.
    boot_s       that its kind takes to boot, at most.
    is_up        its agent answers. trouble: what it or QEMU complained of.
    """

    def __init__(self, loop: Loop, made: Kind, name: str, folder: Path, date: str, devices: Sequence[str] = ()) -> None:
        """Supply it. date: of its real-time clock, UTC. devices: further words for QEMU."""
        self.name = name
        self.boot_s = made.boot_s
        self.monitor = folder / f"{name}.qmp"
        self.console = MADE / f"console-{name}.log"
        self.ruler = Ruler()
        self.told: dict[str, Callable[[str], None]] = {}
        self.is_up = False
        self.is_gone = False
        self.trouble: list[str] = []
        self._loop = loop
        self._heard = b""
        self._asked: deque[tuple[int, Answered]] = deque([(0, self._greeted)])
        self._socket, far = socket.socketpair()
        with far, (MADE / f"qemu-{name}.log").open("wb") as complaints:
            own = made.words(folder, name, date, self.console)
            words = _command(own, self.monitor, devices)
            self._process = subprocess.Popen(
                words,
                stdin=far.fileno(),
                stdout=far.fileno(),
                stderr=complaints,
                preexec_fn=die_with_parent(signal.SIGKILL),  # noqa: PLW1509 - no other thread runs here
            )
        try:
            made.has_power(folder, name)
        except BaseException:
            self._process.kill()
            raise
        loop.add(self)

    # A source of the loop

    def fileno(self) -> int:
        return self._socket.fileno()

    def ready(self, events: int) -> None:
        try:
            octets = self._socket.recv(BATCH)
        except OSError:
            octets = b""
        at_ns = host_ns()
        if not octets:
            self.is_gone = True
            self._loop.remove(self)
            return
        *lines, self._heard = (self._heard + octets).split(b"\n")
        for line in lines:
            self._take(json.loads(line), at_ns)

    def _take(self, said: dict[str, Any], at_ns: int) -> None:
        if "answer" in said:
            asked_ns, answered = self._asked.popleft()
            if "error" in said:
                self.trouble.append(said["error"])
            if asked_ns:
                clocks = Clocks(*said["answer"])
                self.ruler.after(asked_ns, clocks.raw_ns)
                self.ruler.before(at_ns, clocks.raw_ns)
            answered(said["answer"])
        elif "line" in said:
            self.told.get(said["program"], _ignored)(said["line"])
        else:
            self.trouble.append(f"{said['program']} has ended with {said['ended']}")

    # What is asked for

    def clocks(self, answered: Callable[[Clocks], None]) -> None:
        """The guest's clocks, at a moment between this and the call; the ruler has learnt of both."""
        asked_ns = host_ns()
        self._ask({"do": "clocks"}, lambda answer: answered(Clocks(*answer)), asked_ns)

    def pulse(self, answered: Callable[[Pulse], None]) -> None:
        """The kernel's last pulse: not called where there was none yet."""

        def parsed(answer: tuple[str, Any] | None) -> None:
            if answer is None:
                return
            text, clocks = answer
            stamp, is_there, sequence = text.strip().partition("#")
            if is_there:
                answered(pulse_at(int(sequence), int(stamp.replace(".", "")), Clocks(*clocks)))

        self._ask({"do": "pulse"}, parsed)

    def step(self, ns: int) -> None:
        """Put the system's clock wrong."""
        self._ask({"do": "step", "ns": ns})

    def write(self, path: str, text: str) -> None:
        self._ask({"do": "write", "path": path, "text": text})

    def start(self, name: str, *words: str) -> None:
        self._ask({"do": "start", "name": name, "words": words})

    def run(self, words: Sequence[str], answered: Callable[[str | None], None]) -> None:
        """A program to its end, a short one: the agent does nothing else meanwhile. None: it could not be run."""
        self._ask({"do": "run", "words": words}, answered)

    def kill(self) -> None:
        """Take away its power; idempotent."""
        if not self.is_gone:
            self.is_gone = True
            self._loop.remove(self)
        self._process.kill()
        self._process.wait()
        self._socket.close()

    def hurry(self) -> None:
        """Let it come before what else this machine does, where that is permitted: its interrupts are measured."""
        with suppress(PermissionError):
            for thread in Path(f"/proc/{self._process.pid}/task").iterdir():
                os.sched_setscheduler(int(thread.name), os.SCHED_RR, os.sched_param(1))

    def last_words(self) -> str:
        """Of its console."""
        return self.console.read_text(errors="replace")[-2000:] if self.console.exists() else ""

    def _ask(self, what: dict[str, Any], answered: Answered = lambda answer: None, asked_ns: int = 0) -> None:
        self._asked.append((asked_ns, answered))
        if not self.is_gone:
            self._socket.sendall(json.dumps(what).encode() + b"\n")

    def _greeted(self, version: str) -> None:
        self.is_up = True


def _ignored(line: str) -> None: ...


def _command(own: Sequence[str], monitor: Path, devices: Sequence[str]) -> list[str]:
    COMPILED.mkdir(exist_ok=True)
    return [
        *("qemu-system-aarch64", "-nodefaults", "-no-user-config", "-display", "none", "-no-reboot"),
        *own,
        *("-qmp", f"unix:{monitor},server=on,wait=off"),
        *("-device", "virtio-serial-pci", "-chardev", "stdio,id=agent,signal=off"),
        *("-device", "virtserialport,chardev=agent,name=bench"),
        *devices,
        *(() if "-netdev" in devices else ("-nic", "none")),
    ]
