"""A real chronyd: Debian's, in a folder of its own, which cannot touch the machine's clock and is ended by its pid."""

import logging
import os
import pwd
import signal
import socket
import subprocess
import time
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Self

from board.runtime.child import die_with_parent
from board.runtime.journal import Journal
from board.time.scales import EPOCH, LEAPS, LeapEvent
from pps.chrony.feed import Refclock
from pps.chrony.tracking import Tracking, tracking
from pps.pulse import Clocks, pulse_at, read_clocks

PATIENCE = 10.0  # s; reached only by a test that fails
# Unpacked by .ci/setup and not installed: it would take the place of the machine's own, and AppArmor would confine it
# to the folders of that one.
ROOT = Path(__file__).resolve().parents[2] / "build/chrony"
PROGRAM = ROOT / "usr/sbin/chronyd"
CHRONYC = ROOT / "usr/bin/chronyc"

# Fed without a pause: what takes minutes at a sample per second takes part of one.
QUICK = "refclock SOCK {socket} refid PPS poll -6 filter 1 precision 1e-7\n"
OWN = """
cmdport 0
bindcmdaddress {command}
pidfile {folder}/pid
"""
STAMPED_AGO_NS = 1_000_000  # of the pulses that are made


class Chronyd:
    """chronyd; not started. What is given stays as it is over a restart.

    folder         its own, of the test's user alone: otherwise it makes no command socket.
    configuration  beside what keeps it to its folder; {socket} is the path that is fed.
    shift_s        of its clock against the machine's, by libfaketime. rate: how much faster it goes.
    """

    def __init__(self, folder: Path, configuration: str = QUICK, *, shift_s: int = 0, rate: int = 1) -> None:
        assert PROGRAM.exists(), "build/chrony is not here: .ci/setup test"
        folder.chmod(0o700)
        self.folder = folder
        self.socket = folder / "pps.sock"
        self.command = folder / "command.sock"
        self.shift_s, self.rate = shift_s, rate
        self._started_ns = 0
        self._process: subprocess.Popen[bytes] | None = None
        self._file = folder / "chrony.conf"
        self._file.write_text(
            configuration.format(socket=self.socket) + OWN.format(command=self.command, folder=folder)
        )
        assert len(str(self.command)) < 90, f"{folder}: too long for sockets: set TMPDIR"

    @property
    def pid(self) -> int:
        assert self._process is not None
        return self._process.pid

    @property
    def log(self) -> str:
        return (self.folder / "log").read_text()

    def start(self) -> Self:
        """Start it and wait until it can be asked and fed."""
        user = pwd.getpwuid(os.getuid()).pw_name
        self._started_ns = time.time_ns()
        with (self.folder / "log").open("a") as log:
            self._process = subprocess.Popen(
                [PROGRAM, "-x", "-d", "-U", "-u", user, "-f", str(self._file)],
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                env={**os.environ, **self._faked()},
                preexec_fn=die_with_parent(signal.SIGKILL),  # noqa: PLW1509 - one thread of Python starts it
            )
        end = time.monotonic() + PATIENCE
        while not (self.socket.exists() and self._listens()):
            assert self._process.poll() is None, f"chronyd has ended:\n{self.log}"
            assert time.monotonic() < end, f"chronyd does not listen:\n{self.log}"
        return self

    def stop(self, number: int = signal.SIGTERM) -> None:
        """End it; with SIGKILL its sockets stay behind. Idempotent."""
        process, self._process = self._process, None
        if process is not None:
            process.send_signal(signal.SIGCONT)
            process.send_signal(number)
            process.wait(PATIENCE)
            self.command.unlink(missing_ok=True)

    def freeze(self) -> None:
        """It hangs, until thaw()."""
        os.kill(self.pid, signal.SIGSTOP)

    def thaw(self) -> None:
        os.kill(self.pid, signal.SIGCONT)

    def clocks(self) -> Clocks:
        """The machine's clocks as chronyd has them; at a rate, up to that many times 20 ms ahead of it."""
        now = read_clocks()
        gone_ns = now.system_ns - self._started_ns
        ahead_ns = (self.rate - 1) * gone_ns
        return Clocks(
            now.system_ns + ahead_ns + self.shift_s * 10**9, now.raw_ns + ahead_ns, now.monotonic + ahead_ns / 1e9
        )

    @property
    def chronyc(self) -> tuple[str, ...]:
        return (str(CHRONYC), "-h", str(self.command), "-n", "-c")

    def tracking(self) -> Tracking:
        """What it says now."""
        asked = subprocess.run(
            [*self.chronyc, "tracking"], capture_output=True, text=True, timeout=PATIENCE, check=True
        )
        return tracking(asked.stdout)

    def until(
        self,
        feed: Callable[[], object],
        is_so: Callable[[Tracking], bool],
        lasting: int = 1,
        patience: float = PATIENCE,
    ) -> Tracking:
        """Feed it and ask it until something is so, for so many updates of its clock one after the other."""
        end = time.monotonic() + patience
        since: set[float] = set()
        while True:
            feed()
            state = self.tracking()
            since = since | {state.updated_unix_s} if is_so(state) else set()
            if len(since) >= lasting:
                return state
            assert time.monotonic() < end, f"it is not so: {state}\n{self.log}"

    def _listens(self) -> bool:
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as probe:
            return probe.connect_ex(str(self.command)) == 0

    def _faked(self) -> dict[str, str]:
        if self.shift_s == 0 and self.rate == 1:
            return {}
        (library,) = ROOT.glob("usr/lib/*/faketime/libfaketime.so.1")
        return {
            "LD_PRELOAD": str(library),
            "FAKETIME": f"{self.shift_s:+d}" + (f" x{self.rate}" if self.rate > 1 else ""),
        }

    def __enter__(self) -> Self:
        return self.start()

    def __exit__(self, *_: object) -> None:
        self.stop()


class Feeder:
    """Pulses of a truth that chronyd's system clock is offset_ns behind, told by a Refclock of this process."""

    def __init__(self, chronyd: Chronyd) -> None:
        self.offset_ns = 0
        self.leap: LeapEvent | None = None
        self.refclock = Refclock(str(chronyd.socket), Journal(logging.getLogger("test"), "chrony", time.monotonic))
        self._clocks = chronyd.clocks
        self._sequence = 0

    def __call__(self, ago_ns: int = STAMPED_AGO_NS) -> bool:
        """A pulse that long ago, told now."""
        now = self._clocks()
        self._sequence += 1
        pulse = pulse_at(self._sequence, now.system_ns - ago_ns, now)
        unix_ns = pulse.system_ns + self.offset_ns
        return self.refclock.sample(pulse, unix_ns // 10**9 - EPOCH + len(LEAPS), unix_ns, self.leap, now)


def shift_to(moment: str) -> int:
    """Seconds from now to a moment of UTC."""
    return _unix_s(moment) - int(time.time())


def event(day_after: str, change: int) -> LeapEvent:
    """A leap second at the end of the day before, where none has been inserted since 2017."""
    its_s = _unix_s(day_after) - EPOCH + len(LEAPS)
    return LeapEvent(its_s if change > 0 else its_s - 1, change)


def _unix_s(moment: str) -> int:
    return int(datetime.fromisoformat(moment).replace(tzinfo=UTC).timestamp())
