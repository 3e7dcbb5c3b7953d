"""Connections by descriptor, which may be reused in the meantime."""

import errno
import os
import socket
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest

from firmware.endpoint.peers.connection import Connection

ABSTRACT = f"captain-test-{os.urandom(8).hex()}"


@contextmanager
def accepted(family: int, address: object) -> Iterator[tuple[socket.socket, socket.socket]]:
    """Both ends of a connection, the accepted one first."""
    with socket.socket(family, socket.SOCK_STREAM) as listener, socket.socket(family, socket.SOCK_STREAM) as peer:
        listener.bind(address)  # type: ignore[arg-type]
        listener.listen()
        peer.connect(listener.getsockname())
        own, _ = listener.accept()
        with own:
            yield own, peer


def is_open(peer: socket.socket) -> bool:
    peer.settimeout(0.01)
    try:
        return peer.recv(1) != b""
    except TimeoutError:
        return True


@pytest.mark.parametrize(
    ("family", "host", "bound"),
    [
        (socket.AF_INET, "127.0.0.1", "127.0.0.1"),
        (socket.AF_INET, "127.0.0.1", "0.0.0.0"),
        (socket.AF_INET6, "::1", "[::1]"),
        (socket.AF_INET6, "::1", "[::]"),
    ],
)
def test_a_connection_of_tcp_is_known_and_can_be_cut(family: int, host: str, bound: str) -> None:
    with accepted(family, (host, 0)) as (own, peer):
        endpoint = f"tcp://{bound}:{own.getsockname()[1]}"
        with closing(Connection(own.fileno(), endpoint, "to_users")) as connection:
            assert (connection.address, connection.port) == peer.getsockname()[:2]
            assert connection.is_local
            assert not connection.is_unix
            connection.cut()
            assert not is_open(peer)


@pytest.mark.parametrize("is_abstract", [True, False])
def test_a_connection_of_a_unix_socket_is_known_and_can_be_cut(tmp_path: Path, is_abstract: bool) -> None:
    name = f"@{ABSTRACT}" if is_abstract else str(tmp_path / "socket")
    with (
        accepted(socket.AF_UNIX, name.replace("@", "\0")) as (own, peer),
        closing(Connection(own.fileno(), f"ipc://{name}", "report")) as connection,
    ):
        assert connection.is_unix
        assert connection.is_local
        connection.cut()
        assert not is_open(peer)


@pytest.mark.parametrize("what", ["file", "TCP", "TCP listener", "UDP", "Unix", "closed"])
def test_a_number_that_belongs_to_something_else_is_left_alone(tmp_path: Path, what: str) -> None:
    with (
        accepted(socket.AF_INET, ("127.0.0.1", 0)) as (other, peer),
        accepted(socket.AF_UNIX, f"\0{ABSTRACT}") as (other_unix, peer_unix),
        socket.create_server(("127.0.0.1", 0)) as listener,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp,
        open(tmp_path / "file", "wb") as file,
    ):
        udp.bind(listener.getsockname())
        number = {"file": file, "TCP": other, "TCP listener": listener, "UDP": udp, "Unix": other_unix}
        descriptor = number[what].fileno() if what in number else 1_000_000
        before = len(os.listdir("/proc/self/fd"))
        connection = Connection(descriptor, f"tcp://127.0.0.1:{listener.getsockname()[1]}", "to_users")
        assert not connection.is_unix
        assert not connection.is_local
        assert connection.fileno() == -1
        connection.cut()
        assert is_open(peer)
        assert is_open(peer_unix)
        assert len(os.listdir("/proc/self/fd")) == before


def test_a_connection_for_which_there_is_no_descriptor_is_not_trusted(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(descriptor: int) -> int:
        raise OSError(errno.EMFILE, "Too many open files")

    with accepted(socket.AF_UNIX, f"\0{ABSTRACT}") as (own, _):
        monkeypatch.setattr("firmware.endpoint.peers.connection.os.dup", refuse)
        connection = Connection(own.fileno(), f"ipc://@{ABSTRACT}", "report")
        assert not connection.is_unix
        assert not connection.is_local
