"""Stalled connection to a broker: it ends soon, and its unsent messages are dropped."""

import errno
import select
import socket
from collections.abc import Iterator

import pytest

from drivers.mqtt.client import trouble
from drivers.mqtt.client.backoff import AWAY_S
from drivers.mqtt.client.connector import SEND_BUFFER, UNSENT, Connector
from drivers.mqtt.client.line import BrokerLine
from drivers.mqtt.client.settings import STALL_S, MqttSettings
from tests.drivers.mqtt.model import Bench

PATIENCE_S = 5.0  # reached only by a test that fails


@pytest.fixture
def listener() -> Iterator[socket.socket]:
    with socket.create_server(("127.0.0.1", 0)) as made:
        made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)  # accepted connections inherit it
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
    # Without this option, a dead connection ends only after 15 minutes (tcp(7), tcp_retries2). By then, a vehicle has
    # changed its address many times.
    assert connection.getsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT) == 1000 * STALL_S


def test_what_a_given_up_connection_has_not_sent_is_never_sent(
    listener: socket.socket, connection: socket.socket
) -> None:
    broker, _ = listener.accept()
    written = _fill(connection)
    BrokerLine(connection).discard()
    with broker:
        read, error = _read_all(broker)
    assert isinstance(error, ConnectionResetError)
    assert read < written


def test_a_kernel_keeps_no_more_than_a_slow_network_takes_in_seconds(connection: socket.socket) -> None:
    # The kernel doubles the requested size (socket(7)). Its default would buffer 2.5 MB and more, and each buffered
    # message counts as SENT.
    assert connection.getsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF) == 2 * SEND_BUFFER
    assert connection.getsockopt(socket.IPPROTO_TCP, socket.TCP_NOTSENT_LOWAT) == UNSENT


def test_a_vehicle_that_the_network_cuts_off_again_and_again_is_soon_back_each_time() -> None:
    # An earlier version doubled the back-off at each tunnel, and reported another client with the same id as the cause.
    bench = Bench().accept()
    for _ in range(10):
        bench.session.lost("does not answer any more", bench.now, is_cut=True)
        assert "client_id" not in bench.states[-1][1]
        bench.client.calls.clear()
        bench.run(bench.settings.first_delay_s)
        assert bench.client.calls == ["connect"]
        bench.accept()


def test_without_any_network_it_is_tried_every_other_second() -> None:
    bench = Bench()
    for _ in range(10):
        bench.session.failed("no route to it", bench.now, is_away=True)
        bench.client.calls.clear()
        bench.run(AWAY_S)
        assert bench.client.calls == ["connect"]


def test_a_broker_that_does_not_answer_is_asked_less_and_less_whatever_the_network_did_before() -> None:
    bench = Bench()
    for _ in range(10):
        bench.session.failed("no route to it", bench.now, is_away=True)
        bench.run(AWAY_S)
    bench.session.failed("refuses the connection", bench.now)
    bench.client.calls.clear()
    bench.run(bench.settings.longest_delay_s - 1.0)
    assert bench.client.calls == []


@pytest.mark.parametrize(
    ("error", "is_cut", "is_away"),
    [
        (TimeoutError(errno.ETIMEDOUT, ""), True, False),
        (OSError(errno.ENETUNREACH, ""), True, True),
        (socket.gaierror(socket.EAI_AGAIN, ""), True, True),
        (socket.gaierror(socket.EAI_NONAME, ""), False, False),
        (ConnectionResetError(errno.ECONNRESET, ""), False, False),
        (ConnectionRefusedError(errno.ECONNREFUSED, ""), False, False),
        (EOFError(), False, False),
    ],
)
def test_what_the_network_does_is_told_from_what_a_broker_does(error: Exception, is_cut: bool, is_away: bool) -> None:
    assert (trouble.is_cut(error), trouble.is_away(error)) == (is_cut, is_away)


def _fill(connection: socket.socket) -> int:
    """Return the number of octets that the kernel accepts for a peer that reads nothing."""
    written = 0
    try:
        while True:
            written += connection.send(bytes(65536))
    except BlockingIOError:
        return written


def _read_all(connection: socket.socket) -> tuple[int, OSError | None]:
    """Read until the end. Return the number of octets, and the error at the end if there is one."""
    read = 0
    try:
        while octets := connection.recv(65536):
            read += len(octets)
    except OSError as error:
        return read, error
    return read, None
