"""A drive for QEMU whose power can be cut: a block server (NBD) in front of a medium that loses what was not flushed.

Killing QEMU alone leaves everything in this machine's memory: that is a kernel that dies, and no power cut.
Source of the protocol: NetworkBlockDevice/nbd, doc/proto.md: newstyle handshake, simple replies.
"""

import contextlib
import socket
import struct
import threading
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from random import Random
from typing import NamedTuple

from tests.proof.image.medium import SECTOR, Fate, Loss, Medium

MAGIC, OPTION, REPLY = b"NBDMAGIC", 0x49484156454F5054, 0x3E889045565A9
FIXED_NEWSTYLE, NO_ZEROES = 1, 2
EXPORT_NAME, ABORT, INFO, GO = 1, 2, 6, 7
ACK, TOLD, UNSUPPORTED = 1, 3, (1 << 31) + 1
INFO_EXPORT, INFO_BLOCK_SIZE = 0, 3
FLAGS = 0b1101101  # flags are sent; flush, durable writes (FUA), trim and zeros are known
READ, WRITE, DISCONNECT, FLUSH, TRIM, ZEROES = 0, 1, 2, 3, 4, 6
FUA = 1
REQUEST, ANSWER = struct.Struct(">IHH8sQI"), struct.Struct(">II8s")
REQUEST_MAGIC, ANSWER_MAGIC = 0x25609513, 0x67446698
INVALID = 22
MOST = 32 << 20  # octets of a request
MIB = 1 << 20


class Arm(NamedTuple):
    """A cut that comes by itself: when so many requests of a kind have come from now on, before that one's answer.

    within  octets of the card; a flush is everywhere.
    """

    requests: int
    kinds: frozenset[int]
    fate: Fate
    within: range


class Drive:
    """One drive. Each connection to it is a time with power: it begins with QEMU and ends with a cut.

    card    a file, which is changed.
    socket  where QEMU finds it.
    seed    of what a cut leaves.

    requests  how many of each kind there were; writes and octets: of them what was written, by the MiB where it went.
    loss      of the last cut; cut_s: when it was, on the monotonic clock.
    is_cut    set when the power goes; is_powered: when it comes, which is when QEMU connects.
    is_honest it does what it says when it is told to flush. One that does not is there to see that this is noticed.
    """

    def __init__(self, card: Path, place: Path, seed: int, is_honest: bool = True) -> None:
        self.medium = Medium(card)
        self.requests: Counter[int] = Counter()
        self.writes: Counter[int] = Counter()
        self.octets: Counter[int] = Counter()
        self.loss = Loss(0, 0, 0, 0)
        self.cut_s = 0.0
        self.is_cut = threading.Event()
        self.is_powered = threading.Event()
        self._is_honest = is_honest
        self._random = Random(seed)
        self._lock = threading.Lock()
        self._arm: Arm | None = None
        self._place = place
        place.unlink(missing_ok=True)
        self._listener = socket.socket(socket.AF_UNIX)
        self._listener.bind(str(place))
        self._listener.listen(1)
        self._is_closed = False
        self._thread = threading.Thread(target=self._serve, name="drive", daemon=True)
        self._thread.start()

    @property
    def url(self) -> Path:
        """As QEMU's -drive file= wants it."""
        return Path(f"nbd:unix:{self._place}")

    def arm(self, requests: int, fate: Fate, *kinds: int, within: range | None = None) -> None:
        """Cut the power at a request to come; kinds: WRITE and what writes zeros, if none is named."""
        with self._lock:
            self._arm = Arm(requests, frozenset(kinds or (WRITE, ZEROES)), fate, within or range(self.medium.size))

    def cut(self, fate: Fate) -> Loss:
        """Cut it now, unless it is cut already. Nothing is answered until QEMU connects again."""
        with self._lock:
            if not self.is_cut.is_set():
                self._cut(fate)
            return self.loss

    def close(self) -> None:
        self._is_closed = True
        with contextlib.suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        self._thread.join(10)
        self.medium.close()

    def _cut(self, fate: Fate, unanswered: tuple[int, bytes] | None = None) -> None:
        self._arm = None
        self.loss = self.medium.cut(fate, self._random, unanswered)
        self.cut_s = time.monotonic()
        self.is_powered.clear()
        self.is_cut.set()

    def _serve(self) -> None:
        while not self._is_closed:
            try:
                peer, _ = self._listener.accept()
            except OSError:
                return
            with peer, contextlib.suppress(ConnectionError):
                with self._lock:
                    self.is_cut.clear()
                    self.is_powered.set()
                if _shake_hands(peer, self.medium.size):
                    self._answer(peer)

    def _answer(self, peer: socket.socket) -> None:
        while True:
            magic, flags, kind, cookie, offset, size = REQUEST.unpack(_octets(peer, REQUEST.size))
            if magic != REQUEST_MAGIC:
                raise ConnectionError(f"{magic:#x} is not a request's magic")
            if kind == WRITE and size > MOST:
                raise ConnectionError(f"a write of {size} octets")  # its octets would have to be read
            given = _octets(peer, size) if kind == WRITE else b""
            if kind == DISCONNECT:
                return
            with self._lock:
                if self.is_cut.is_set():
                    continue  # no power: nobody answers
                answer = self._done(kind, flags, offset, size, given)
            if answer is None:
                continue
            error, octets = answer
            peer.sendall(ANSWER.pack(ANSWER_MAGIC, error, cookie) + octets)

    def _done(self, kind: int, flags: int, offset: int, size: int, given: bytes) -> tuple[int, bytes] | None:
        """An error and octets; None: the power went."""
        if kind != FLUSH and (offset % SECTOR or size % SECTOR or offset + size > self.medium.size):
            return INVALID, b""
        if kind == READ and size > MOST:
            return INVALID, b""
        self.requests[kind] += 1
        self.writes[offset // MIB] += kind in (WRITE, ZEROES)
        if self._is_due(kind, offset):
            assert self._arm is not None
            octets = given or (bytes(min(size, MOST)) if kind in (TRIM, ZEROES) else b"")
            self._cut(self._arm.fate, (offset, octets) if octets else None)
            return None
        is_durable = bool(flags & FUA) and self._is_honest
        if kind == READ:
            return 0, self.medium.read(offset, size)
        if kind == WRITE:
            self.octets[offset // MIB] += size
            self.medium.write(offset, given, is_durable)
        elif kind in (TRIM, ZEROES):
            self.medium.zero(offset, size, is_durable)
        elif kind == FLUSH:
            if self._is_honest:
                self.medium.flush()
        else:
            return INVALID, b""
        return 0, b""

    def _is_due(self, kind: int, offset: int) -> bool:
        if self._arm is None or kind not in self._arm.kinds or offset not in self._arm.within:
            return False
        self._arm = self._arm._replace(requests=self._arm.requests - 1)
        return self._arm.requests <= 0


@contextlib.contextmanager
def served(card: Path, folder: Path, seed: int, is_honest: bool = True) -> Iterator[Drive]:
    drive = Drive(card, folder / "drive", seed, is_honest)
    try:
        yield drive
    finally:
        drive.close()


def _shake_hands(peer: socket.socket, size: int) -> bool:
    """Whether the peer goes on with requests."""
    peer.sendall(MAGIC + struct.pack(">QH", OPTION, FIXED_NEWSTYLE | NO_ZEROES))
    (wanted,) = struct.unpack(">I", _octets(peer, 4))
    while True:
        magic, option, length = struct.unpack(">QII", _octets(peer, 16))
        if magic != OPTION or length > 65_536:
            raise ConnectionError("no option follows")
        _octets(peer, length)
        export = struct.pack(">QH", size, FLAGS)
        if option == EXPORT_NAME:
            peer.sendall(export + (b"" if wanted & NO_ZEROES else bytes(124)))
            return True
        if option in (INFO, GO):
            _reply(peer, option, TOLD, struct.pack(">H", INFO_EXPORT) + export)
            _reply(peer, option, TOLD, struct.pack(">HIII", INFO_BLOCK_SIZE, SECTOR, 4096, MOST))
            _reply(peer, option, ACK)
            if option == GO:
                return True
        elif option == ABORT:
            _reply(peer, option, ACK)
            return False
        else:
            _reply(peer, option, UNSUPPORTED)


def _reply(peer: socket.socket, option: int, kind: int, octets: bytes = b"") -> None:
    peer.sendall(struct.pack(">QIII", REPLY, option, kind, len(octets)) + octets)


def _octets(peer: socket.socket, size: int) -> bytes:
    found = bytearray(size)
    view = memoryview(found)
    while view:
        got = peer.recv_into(view)
        if not got:
            raise ConnectionError("the other end has gone")
        view = view[got:]
    return bytes(found)
