"""A network cable of the guest whose other end this machine holds: Ethernet frames as datagrams, no privilege needed."""

import socket
import threading
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

from tests.proof.image.machine import NotSeenError

# QEMU's usb-net has the ids of a gadget that two drivers take, and the network is configured with one of them: without
# these words on the kernel's command line it is the one that comes first.
ONE_DRIVER = "module_blacklist=cdc_subset"
BATCH = 8192  # frames that are kept
MAX_FRAME = 65536
# Of a hardware address, its first octets: QEMU's, which nobody was given, and those of a maker. Source: RFC 7042, 2.1.2.
QEMUS, MAKERS = bytes((0x52, 0x54, 0, 0x43, 0)), bytes((0, 0, 0x5E, 0, 0x53))
POLL_S = 0.2


class Wire:
    """One network device of the guest, and what it sends.

    words    of QEMU's command line; device: "virtio-net-pci" or "usb-net".
    guest    the hardware address of its end, which begins with address; ours: of this one.
    frames   what came and nobody has looked at, the newest last.
    answer   is given each frame as it comes, and returns what is sent back at once.
    """

    def __init__(
        self, folder: Path, name: str, number: int, device: str = "virtio-net-pci", address: bytes = QEMUS
    ) -> None:
        self.name = name
        self.guest = bytes((*address, number))
        self.ours = bytes((0x52, 0x54, 0, 0x43, 1, number))
        self.frames: deque[bytes] = deque(maxlen=BATCH)
        self.count = 0
        self.answer: Callable[[bytes], Sequence[bytes]] = lambda _: ()
        self._came = threading.Condition()
        self._far = folder / f"{name}.guest"
        own = folder / f"{name}.own"
        for path in (own, self._far):
            path.unlink(missing_ok=True)
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.bind(str(own))
        self._sender = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        mac = ":".join(f"{octet:02x}" for octet in self.guest)
        rom = ",romfile=" if device.endswith("-pci") else ""
        self.words = [
            "-netdev",
            f"dgram,id={name},local.type=unix,local.path={self._far},remote.type=unix,remote.path={own}",
            "-device",
            f"{device},netdev={name},mac={mac}{rom}",
        ]
        self._is_open = True
        self._thread = threading.Thread(target=self._serve, daemon=True)

    def start(self) -> None:
        """Hear, once the machine runs: a process is not forked while threads do."""
        self._thread.start()

    def send(self, frame: bytes) -> None:
        """Waits for room: nothing is lost between here and the guest's device."""
        with suppress(ConnectionRefusedError, FileNotFoundError):  # its power is off
            self._sender.sendto(frame.ljust(60, b"\0"), str(self._far))

    def wait(self, is_it: Callable[[bytes], bool], limit_s: float, what: str) -> bytes:
        """The first frame of those that nobody has looked at, or of those to come. Raises NotSeenError."""
        found: list[bytes] = []

        def look() -> bool:
            while self.frames:
                frame = self.frames.popleft()
                if is_it(frame):
                    found.append(frame)
                    return True
            return False

        with self._came:
            if self._came.wait_for(look, limit_s):
                return found[0]
        raise NotSeenError(f"{self.name}: {what} did not come within {limit_s:.0f} s")

    def close(self) -> None:
        self._is_open = False
        if self._thread.is_alive():
            self._thread.join()
        self._socket.close()
        self._sender.close()

    def _serve(self) -> None:
        self._socket.settimeout(POLL_S)
        while self._is_open:
            try:
                frame = self._socket.recv(MAX_FRAME)
            except TimeoutError:
                continue
            for reply in self.answer(frame):
                self.send(reply)
            with self._came:
                self.count += 1
                self.frames.append(frame)
                self._came.notify_all()
