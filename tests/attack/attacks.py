"""Hostile peers of the endpoint, each repeated until the station ends it.

usage: python -m tests.attack.attacks NAME PORT [CONNECTIONS]
"""

import socket
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress

from tests.hostile import Peer, frame

AGAIN_S = 0.2  # until a peer that was ended comes again
PART = frame(bytes(60_000), more=True)
EMPTY = frame(b"", more=True) * 4096
CONNECTIONS = 1_100
SUBSCRIBERS = 200
SMALL_BUFFER = 4096


def unsubscribe(port: int) -> None:
    """Unsubscribe from topics that this peer never subscribed to."""
    peer = Peer(port)
    for topic in (b"", b"raw.", b"frame.", b"status.", b"confirm.", b"indication."):
        for _ in range(8):
            peer.unsubscribe(topic)
    peer.is_cut()
    peer.close()


def giant_topic(port: int) -> None:
    """One topic of 16 MiB."""
    _send_until_cut(port, b"SUB", iter([frame(b"\1" + bytes(16 << 20))]))


def topics(port: int) -> None:
    """Topics of 200 octets without end."""
    _send_until_cut(port, b"SUB", (frame(b"\1" + b"%d." % number + bytes(190)) for number in range(1 << 20)))


def endless_push(port: int) -> None:
    """A message whose parts do not end, to the PULL socket."""
    _send_until_cut(port, b"PUSH", iter(lambda: PART, b""))


def endless_pub(port: int) -> None:
    """As endless_push(), to the SUB socket."""
    _send_until_cut(port, b"PUB", iter(lambda: PART, b""))


def endless_sub(port: int) -> None:
    """As endless_push(), from a subscriber."""
    _send_until_cut(port, b"SUB", iter(lambda: frame(bytes(900), more=True) * 64, b""))


def empty_parts(port: int) -> None:
    """Parts without octets: each costs libzmq 32 times as much memory."""
    _send_until_cut(port, b"PUSH", iter(lambda: EMPTY, b""))


def idle(port: int, count: int = CONNECTIONS) -> None:
    """Connections that do nothing."""
    _hold(port, b"PUSH", count, 1.0)


def slow(port: int, count: int = SUBSCRIBERS) -> None:
    """Subscribers to everything that never read."""
    _hold(port, b"SUB", count, 10.0, frame(b"\1"))


def _send_until_cut(port: int, kind: bytes, parts: Iterator[bytes]) -> None:
    peer = Peer(port, kind)
    with suppress(OSError):
        for part in parts:
            peer.socket.sendall(part)
        while not peer.is_cut():
            time.sleep(AGAIN_S)
    peer.close()


def _hold(port: int, kind: bytes, count: int, hold_s: float, after: bytes = b"") -> None:
    """Hold connections for a time; then they come again."""
    held: list[socket.socket] = []
    with suppress(OSError):
        for _ in range(count):
            peer = Peer(port, kind)
            peer.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, SMALL_BUFFER)
            peer.socket.sendall(after)
            held.append(peer.socket)
    time.sleep(hold_s)
    for one in held:
        one.close()


# Name -> what is done, and at which ports.
ATTACKS: dict[str, tuple[Callable[..., None], tuple[str, ...]]] = {
    "unsubscribe": (unsubscribe, ("to_users", "report")),
    "giant-topic": (giant_topic, ("to_users", "report")),
    "topics": (topics, ("to_users", "report")),
    "endless-push": (endless_push, ("pull",)),
    "endless-pub": (endless_pub, ("from_users",)),
    "endless-sub": (endless_sub, ("to_users", "report")),
    "empty-parts": (empty_parts, ("pull",)),
    "idle": (idle, ("pull",)),
    "slow": (slow, ("to_users",)),
}


def main() -> None:
    attack, numbers = ATTACKS[sys.argv[1]][0], [int(word) for word in sys.argv[2:]]
    while True:
        with suppress(OSError, TimeoutError):
            attack(*numbers)
        time.sleep(AGAIN_S)


if __name__ == "__main__":
    main()
