"""PPS device /dev/ppsN: waits for pulses in a thread.

poll() does not work: kernels before 2025 always report "ready", and later ones share one read state between readers.
So a thread waits in PPS_FETCH. After each wait it fetches once more without waiting, for an edge that came since. An
edge between that fetch and the next wait counts as missed, when the following edge comes.
"""

import errno
import fcntl
import os
import threading
from collections import deque
from collections.abc import Callable
from pathlib import Path

from board.runtime.errors import InterfaceError
from board.runtime.loop import Loop
from pps.ioctl import CANWAIT, CAPTURES, Edge, Fetched, Ioctl, fetch, modes
from pps.pulse import OLDEST_NS, REST_S, STORM_NS, Above, Clocks, Pulse, Tally, pulse_at, read_clocks

# Longest wait in one call: half a second more than between two pulses. The thread may outlive stop() by this time.
WAIT_NS = 1_500_000_000
DEPTH = 8  # most edges that wait for the loop; if there are more, the newest are kept

PPS = (
    "add pps-gpio to the device tree: for a box's card device_tree.pulse_gpio in image/image.toml; on Raspberry Pi OS "
    "`sudo captain box setup --write`, or `dtoverlay=pps-gpio,gpiopin=18` in config.txt"
)
PERMISSION = 'add a udev rule: SUBSYSTEM=="pps", GROUP="gpio", MODE="0660"'
HINTS = {
    errno.ENOENT: PPS,
    errno.ENXIO: PPS,
    errno.ENODEV: PPS,
    errno.EACCES: PERMISSION,
    errno.EPERM: PERMISSION,
    errno.ENOTTY: "not a PPS device; see `ls /sys/class/pps`",
    errno.EINVAL: "not a PPS device; see `ls /sys/class/pps`",
}
OTHERWISE = "see `dmesg | grep pps`"


class PulseDevice:
    """Pulses of a PPS device, reported on the loop.

    path   /dev/pps0, or a link to it.
    edge   the device's edge that begins a second.
    ioctl  function for requests to the kernel, as fcntl.ioctl.
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
        """Start reporting pulses; without effect if started. Raises InterfaceError if the device cannot be opened."""
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
        """Stop reporting and return at once; idempotent. The thread ends after its current call, without a report."""
        if self._fetcher is not None:
            self._fetcher.leave()
            self._fetcher = None
            self._loop.remove(self)
            os.close(self._wake)
            self.tally.end()

    def fileno(self) -> int:
        return self._wake

    def ready(self, events: int) -> None:
        """Take the pulses that the thread has fetched.

        Raises RuntimeError if a bug has ended the thread.
        """
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
        except ValueError as error:  # the path contains a NUL
            raise InterfaceError(f"{self.where!r}: {error}", "see device of [pulse] in the board file") from None

    def _look(self, device: int) -> Fetched:
        """Return the last edges; raise InterfaceError unless the device captures this edge and can wait for it."""
        try:
            can, does = modes(self._ioctl, device)
            last = fetch(self._ioctl, device, 0)
        except OSError as error:
            raise explained(self.where, error) from error
        bit = CAPTURES[self._edge]
        if not can & bit:
            others = " or ".join(edge for edge in CAPTURES if can & CAPTURES[edge])
            hint = f"use the edge {others}" if others else "its driver stamps no edges"
            raise InterfaceError(f"{self.where}: stamps no {self._edge} edges (capabilities {can:#x})", hint)
        if not can & CANWAIT:
            hint = "use another driver: pps-gpio or pps-ldisc"
            raise InterfaceError(f"{self.where}: it does not support waiting (capabilities {can:#x})", hint)
        if not does & bit:
            hint = "another program did so with PPS_SETPARAMS: end it, and bind the driver again"
            raise InterfaceError(f"{self.where}: {self._edge} edges are switched off (mode {does:#x})", hint)
        return last

    def _end(self, why: Exception) -> None:
        self.stop()
        if isinstance(why, InterfaceError):
            self._above.failed(why)
            return
        raise RuntimeError(f"{self.where}: its thread ended") from why


class Fetcher:
    """Fetches edges in a thread: it appends them to `found` and signals an eventfd.

    The thread owns and closes both descriptors that start() passes to it. If other code closed them, a descriptor's
    number could belong to another file during a call of the thread.

    found  edges in their order, and at last the reason of the end: InterfaceError, or the exception of a bug.
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
        # A daemon thread, because the end of the program must not wait for its call.
        threading.Thread(target=self._run, args=(device, wake), name=self._path.name, daemon=True).start()

    def leave(self) -> None:
        """End the thread after its current call."""
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
        """Append a new edge to `found`; return how long the next call may wait."""
        last, self._last = self._last, fetched
        if fetched.sequences == last.sequences:  # the call did not wait, and no edge is new
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
        """Return whether the path leads to another device. An unbound driver wakes no reader and stays silent."""
        try:
            there = os.stat(self._path)
        except OSError:
            return True
        return not os.path.samestat(there, os.fstat(device))


def explained(where: str, error: OSError) -> InterfaceError:
    """Return the InterfaceError for an error of the kernel."""
    text = os.strerror(error.errno) if error.errno else str(error)
    return InterfaceError(f"{where}: {text}", HINTS.get(error.errno or 0, OTHERWISE))
