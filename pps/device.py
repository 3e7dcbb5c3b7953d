"""/dev/ppsN: pulses that the kernel stamps.

poll() is of no use: kernels before 2025 say "ready" always, and later ones share between all readers what was read.
So a thread sits in PPS_FETCH; after each call it asks once without waiting, for an edge that has come since. One that
comes in the moment between that and the call that waits is told as missed, with the next.
"""

import errno
import fcntl
import os
import threading
from collections import deque
from collections.abc import Callable
from pathlib import Path

from board.errors import InterfaceError
from board.loop import Loop
from pps.ioctl import CANWAIT, CAPTURES, Edge, Fetched, Ioctl, fetch, modes
from pps.pulse import OLDEST_NS, REST_S, STORM_NS, Above, Clocks, Pulse, Tally, pulse_at, read_clocks

# In one call: half a second more than between two pulses. A thread outlives stop() for so long at most.
WAIT_NS = 1_500_000_000
DEPTH = 8  # edges that wait for the loop; of more, the newest

PPS = (
    "the device tree has to have a pps-gpio: of the box's card by image/image.toml, device_tree.pulse_gpio; on "
    "Raspberry Pi OS by `dtoverlay=pps-gpio,gpiopin=18` in config.txt"
)
PERMISSION = 'a udev rule gives it to a group: SUBSYSTEM=="pps", GROUP="gpio", MODE="0660"'
HINTS = {
    errno.ENOENT: PPS,
    errno.ENXIO: PPS,
    errno.ENODEV: PPS,
    errno.EACCES: PERMISSION,
    errno.EPERM: PERMISSION,
    errno.ENOTTY: "this is no PPS device; `ls /sys/class/pps` lists those that are",
    errno.EINVAL: "this is no PPS device; `ls /sys/class/pps` lists those that are",
}
OTHERWISE = "`dmesg | grep pps` may tell why"


class Device:
    """Pulses of a PPS device, told on the loop.

    path   /dev/pps0, or a link to it.
    edge   which of the device's two begins a second.
    ioctl  what the kernel is asked by.
    """

    def __init__(
        self,
        loop: Loop,
        path: Path,
        above: Above,
        *,
        edge: Edge = "assert",
        ioctl: Ioctl = fcntl.ioctl,
        clocks: Callable[[], Clocks] = read_clocks,
    ) -> None:
        self.where = str(path)
        self.tally = Tally(above)
        self._loop = loop
        self._path = path
        self._above = above
        self._edge: Edge = edge
        self._ioctl = ioctl
        self._clocks = clocks
        self._wake = -1
        self._fetcher: Fetcher | None = None

    def start(self) -> None:
        """Tell pulses above from now on; nothing while started. Raises InterfaceError where they cannot be had."""
        if self._fetcher is not None:
            return
        device = self._open()
        try:
            last = self._look(device)
        except InterfaceError:
            os.close(device)
            raise
        self.tally.begin(last.sequences[self._edge])
        self._wake = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self._fetcher = Fetcher(self._path, self._edge, self._ioctl, self._clocks, last)
        self._fetcher.start(device, os.dup(self._wake))
        self._loop.add(self)

    def stop(self) -> None:
        """Tell no more, and return at once; idempotent. The thread ends when its call does, unheard."""
        if self._fetcher is not None:
            self._fetcher.leave()
            self._fetcher = None
            self._loop.remove(self)
            os.close(self._wake)
            self.tally.end()

    def fileno(self) -> int:
        return self._wake

    def ready(self, events: int) -> None:
        fetcher = self._fetcher
        os.eventfd_read(self._wake)
        for _ in range(DEPTH):
            if fetcher is None or fetcher is not self._fetcher or not fetcher.found:
                return
            found = fetcher.found.popleft()
            if isinstance(found, Pulse):
                self.tally.take(found)
            else:
                self._end(found)

    def _open(self) -> int:
        try:
            return os.open(self._path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK | os.O_NOCTTY)
        except OSError as error:
            raise explained(self.where, error) from error
        except ValueError as error:  # a NUL in it
            raise InterfaceError(f"{self.where!r}: {error}", "see device of [pulse] in the board file") from None

    def _look(self, device: int) -> Fetched:
        """What has come so far, of a device that can do what is asked of it and does it."""
        try:
            can, does = modes(self._ioctl, device)
            last = fetch(self._ioctl, device, 0)
        except OSError as error:
            raise explained(self.where, error) from error
        bit = CAPTURES[self._edge]
        if not can & bit:
            others = " or ".join(edge for edge in CAPTURES if can & CAPTURES[edge])
            hint = f"take the edge {others}" if others else "the driver behind it stamps nothing"
            raise InterfaceError(f"{self.where}: stamps no {self._edge} edges (capabilities {can:#x})", hint)
        if not can & CANWAIT:
            hint = "take another driver: pps-gpio and pps-ldisc can"
            raise InterfaceError(f"{self.where}: nobody can wait for its edges (capabilities {can:#x})", hint)
        if not does & bit:
            hint = "another program has done so, by PPS_SETPARAMS: end it, and bind the driver again"
            raise InterfaceError(f"{self.where}: {self._edge} edges are switched off (mode {does:#x})", hint)
        return last

    def _end(self, why: Exception) -> None:
        self.stop()
        if isinstance(why, InterfaceError):
            self._above.failed(why)
            return
        raise RuntimeError(f"{self.where}: its thread has ended") from why


class Fetcher:
    """The thread's side: what it gets is left in `found`, and an eventfd says so.

    The thread owns both descriptors that it is started with, and closes them: nobody else does, so that no number in
    a call of its own can meanwhile be that of another file.

    found  edges in their order; last, what ended it: InterfaceError, or a bug.
    """

    def __init__(self, path: Path, edge: Edge, ioctl: Ioctl, clocks: Callable[[], Clocks], last: Fetched) -> None:
        self.found: deque[Pulse | Exception] = deque(maxlen=DEPTH)
        self._path = path
        self._edge: Edge = edge
        self._ioctl = ioctl
        self._clocks = clocks
        self._last = last
        self._last_raw_ns: int | None = None
        self._leaves = threading.Event()

    def start(self, device: int, wake: int) -> None:
        # A daemon: the end of the program does not wait for the end of its call.
        threading.Thread(target=self._run, args=(device, wake), name=self._path.name, daemon=True).start()

    def leave(self) -> None:
        """End with the call that it is in."""
        self._leaves.set()

    def _run(self, device: int, wake: int) -> None:
        try:
            end: Exception | None = self._fetch_all(device, wake)
        except Exception as bug:  # noqa: BLE001 (it is raised on the loop)
            end = bug
        os.close(device)
        if end is not None:
            self._tell(end, wake)
        os.close(wake)

    def _fetch_all(self, device: int, wake: int) -> InterfaceError | None:
        wait_ns = 0
        while not self._leaves.is_set():
            try:
                fetched = fetch(self._ioctl, device, wait_ns)
                now = self._clocks()
            except InterruptedError:
                wait_ns = 0
                continue
            except TimeoutError:
                if self._is_gone(device):
                    return InterfaceError(f"{self._path}: it is gone", PPS)
                wait_ns = 0
                continue
            except OSError as error:
                return explained(str(self._path), error)
            wait_ns = self._take(fetched, now, wake)
        return None

    def _take(self, fetched: Fetched, now: Clocks, wake: int) -> int:
        """Leave an edge where it is found; returns how long the next call may wait."""
        last, self._last = self._last, fetched
        if fetched.sequences == last.sequences:  # it did not wait, and there is nothing new
            return WAIT_NS
        sequence = fetched.sequences[self._edge]
        stamp_ns = fetched.stamps_ns[self._edge]
        if sequence != last.sequences[self._edge] and 0 <= now.system_ns - stamp_ns <= OLDEST_NS:
            self._tell(pulse_at(sequence, stamp_ns, now), wake)
        last_raw_ns, self._last_raw_ns = self._last_raw_ns, now.raw_ns
        if last_raw_ns is not None and now.raw_ns - last_raw_ns < STORM_NS:
            self._leaves.wait(REST_S)
        return 0

    def _tell(self, found: Pulse | Exception, wake: int) -> None:
        self.found.append(found)
        os.eventfd_write(wake, 1)

    def _is_gone(self, device: int) -> bool:
        """Whether the path leads elsewhere: a driver that is unbound wakes nobody up, its open device is silent."""
        try:
            there = os.stat(self._path)
        except OSError:
            return True
        return not os.path.samestat(there, os.fstat(device))


def explained(where: str, error: OSError) -> InterfaceError:
    """An error of the kernel as ours."""
    text = os.strerror(error.errno) if error.errno else str(error)
    return InterfaceError(f"{where}: {text}", HINTS.get(error.errno or 0, OTHERWISE))
