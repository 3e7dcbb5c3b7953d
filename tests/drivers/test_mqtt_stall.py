"""A connection to a broker that has come to nothing ends soon, and takes with it what it has not sent."""

import errno
import select
import socket
from collections.abc import Iterator

import pytest

from drivers import mqtt_trouble
from drivers.mqtt_backoff import AWAY_S
from drivers.mqtt_connector import SEND_BUFFER, UNSENT, Connector
from drivers.mqtt_line import Line
from drivers.mqtt_settings import STALL_S, MqttSettings
from tests.drivers.mqtt_model import Bench

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
    assert connection.getsockopt(socket.IPPROTO_TCP, socket.TCP_NOTSENT_LOWAT) == UNSENT


def test_a_vehicle_that_the_network_cuts_off_again_and_again_is_soon_back_each_time() -> None:
    # At each tunnel it waited twice as long as at the last, and blamed another client for it.
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
    assert (mqtt_trouble.is_cut(error), mqtt_trouble.is_away(error)) == (is_cut, is_away)


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
