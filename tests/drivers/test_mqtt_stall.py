"""A connection to a broker that has come to nothing ends soon, and takes with it what it has not sent."""

import select
import socket
from collections.abc import Iterator

import pytest

from drivers.mqtt_connector import SEND_BUFFER, Connector
from drivers.mqtt_line import Line
from drivers.mqtt_settings import STALL_S, MqttSettings

PATIENCE_S = 5.0  # reached only by a test that fails


@pytest.fixture
def listener() -> Iterator[socket.socket]:
    with socket.create_server(("127.0.0.1", 0)) as made:
        made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)  # of what it accepts, too
        made.settimeout(PATIENCE_S)
        yield made


@pytest.fixture
def connection(listener: socket.socket) -> Iterator[socket.socket]:
    connector = Connector(MqttSettings(url=f"mqtt://127.0.0.1:{listener.getsockname()[1]}"))
    assert select.select([connector], [], [], PATIENCE_S)[0]
    connector.close()
    assert connector.socket is not None, connector.why_not
    with connector.socket as made:
        yield made


def test_the_kernel_ends_a_connection_whose_octets_nobody_acknowledges(connection: socket.socket) -> None:
    # Without it that takes 15 minutes (tcp(7), tcp_retries2), and a vehicle has had many addresses by then.
    assert connection.getsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT) == 1000 * STALL_S


def test_what_a_given_up_connection_has_not_sent_is_never_sent(
    listener: socket.socket, connection: socket.socket
) -> None:
    broker, _ = listener.accept()
    written = _fill(connection)
    Line(connection).discard()
    with broker:
        read, error = _read_all(broker)
    assert isinstance(error, ConnectionResetError)
    assert read < written


def test_a_kernel_keeps_no_more_than_a_slow_network_takes_in_seconds(connection: socket.socket) -> None:
    # The kernel doubles what it is asked for (socket(7)). It would keep 2.5 MB and more, each message of it SENT.
    assert connection.getsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF) == 2 * SEND_BUFFER


def _fill(connection: socket.socket) -> int:
    """Octets that a kernel takes for a peer that reads nothing."""
    written = 0
    try:
        while True:
            written += connection.send(bytes(65536))
    except BlockingIOError:
        return written


def _read_all(connection: socket.socket) -> tuple[int, OSError | None]:
    """How many octets come, and with what they end."""
    read = 0
    try:
        while octets := connection.recv(65536):
            read += len(octets)
    except OSError as error:
        return read, error
    return read, None
