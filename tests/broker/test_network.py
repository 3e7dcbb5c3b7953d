"""The bad networks and bad brokers: each does what its name says."""

import select
import socket
import ssl
import time

import pytest

from tests.broker import mute
from tests.broker.bad import FullBacklog, Listener, closing_after, old_tls, saying, silent, tls
from tests.broker.client import Client
from tests.broker.fixtures import Certificates
from tests.broker.mute import Mute
from tests.broker.proxy import CHUNK, Proxy

SHORT = 0.2  # s, in which what must not happen does not
CONNECT = bytes.fromhex("100d00044d51545405020014000000")  # MQTT 5, clean start, keep-alive 20 s, no client id


class Echo(Listener):
    """Says back what it hears."""

    def __init__(self) -> None:
        super().__init__(self._echo)

    @staticmethod
    def _echo(line: socket.socket, _over: object) -> None:
        while octets := line.recv(1 << 16):
            line.sendall(octets)


def connected(port: int) -> socket.socket:
    line = socket.create_connection(("127.0.0.1", port), timeout=5)
    line.settimeout(5)
    return line


def hears_nothing(line: socket.socket) -> bool:
    line.settimeout(SHORT)
    try:
        line.recv(1)
    except TimeoutError:
        line.settimeout(5)
        return True
    return False


def test_a_delay_is_that_of_each_way_and_not_of_each_message() -> None:
    with Echo() as echo, Proxy(echo.port, delay_s=0.1) as proxy, connected(proxy.port) as line:
        before = time.monotonic()
        line.sendall(bytes(20 * CHUNK))  # which it reads in twenty pieces at least: one after another, 2 s and more
        got = 0
        while got < 20 * CHUNK:
            got += len(line.recv(CHUNK))
        assert 0.2 <= time.monotonic() - before < 2


def test_what_is_stalled_comes_when_it_flows_again() -> None:
    with Echo() as echo, Proxy(echo.port) as proxy, connected(proxy.port) as line:
        line.sendall(b"a")
        assert line.recv(1) == b"a"
        proxy.stall()
        line.sendall(b"b")
        assert hears_nothing(line)
        proxy.flow()
        assert line.recv(1) == b"b"


def test_a_cut_is_a_reset_and_the_next_connection_works() -> None:
    with Echo() as echo, Proxy(echo.port) as proxy:
        with connected(proxy.port) as line:
            line.sendall(b"a")
            line.recv(1)
            proxy.cut()
            with pytest.raises(ConnectionResetError):
                line.recv(1)
        with connected(proxy.port) as line:
            line.sendall(b"b")
            assert line.recv(1) == b"b"
        assert proxy.accepted == 2


def test_in_the_dark_everything_is_swallowed_even_a_good_bye() -> None:
    with Echo() as echo, Proxy(echo.port) as proxy, connected(proxy.port) as line:
        line.sendall(b"a")
        line.recv(1)
        proxy.go_dark()
        line.sendall(b"b")
        echo.close()
        assert hears_nothing(line)


def test_refused_and_accepted_again() -> None:
    with Echo() as echo, Proxy(echo.port) as proxy:
        proxy.refuse()
        with pytest.raises(ConnectionRefusedError):
            connected(proxy.port)
        proxy.accept()
        connected(proxy.port).close()


def test_a_limit_takes_its_time() -> None:
    with Echo() as echo, Proxy(echo.port, octets_per_s=1_000_000) as proxy, connected(proxy.port) as line:
        before = time.monotonic()
        line.sendall(bytes(100_000))
        got = 0
        while got < 100_000:
            got += len(line.recv(1 << 16))
        assert 0.1 <= time.monotonic() - before < 2


def test_a_full_backlog_answers_no_syn() -> None:
    with FullBacklog() as full, pytest.raises(TimeoutError):
        socket.create_connection(("127.0.0.1", full.port), timeout=SHORT)


def test_a_silent_listener_stalls_a_handshake(certificates: Certificates) -> None:
    context = ssl.create_default_context(cafile=str(certificates.authority.certificate))
    with Listener(silent) as listener, connected(listener.port) as line:
        line.settimeout(SHORT)
        with pytest.raises(TimeoutError):
            context.wrap_socket(line, server_hostname="localhost")


def test_one_that_closes_and_one_that_babbles() -> None:
    with Listener(closing_after(0)) as listener, connected(listener.port) as line:
        assert line.recv(1) == b""
    with Listener(saying(b"HTTP/1.1 400 Bad Request\r\n\r\n")) as listener, connected(listener.port) as line:
        assert line.recv(4) == b"HTTP"


def test_old_tls_is_too_old(certificates: Certificates) -> None:
    context = ssl.create_default_context(cafile=str(certificates.authority.certificate))
    context.minimum_version = ssl.TLSVersion.TLSv1_2  # Debian's Python leaves it to OpenSSL's configuration
    old = old_tls(certificates.authority, certificates.server)
    with (
        Listener(silent, old) as listener,
        connected(listener.port) as line,
        pytest.raises(ssl.SSLError, match="VERSION"),
    ):
        context.wrap_socket(line, server_hostname="localhost")


@pytest.mark.parametrize("version", [5, 3])
def test_a_mute_that_leaves_nothing_out_is_a_broker(version: int) -> None:
    with Mute() as broker, Client(broker.port, host="127.0.0.1", version=version) as client:
        client.subscribe("t")
        client.publish("t", b"one", qos=1)
        assert broker.next(mute.PUBLISH).body.endswith(b"one")
        broker.throw(mute.publication("t", b"two", version))
        assert client.next().payload == b"two"


@pytest.mark.parametrize("octets", [b"\x10", b"\x10\x85", b"\x10\x05\0\4MQ"])
def test_a_client_that_goes_in_the_middle_of_a_packet_has_sent_none(octets: bytes) -> None:
    ours, theirs = socket.socketpair()
    with ours:
        with theirs:
            theirs.sendall(octets)
        assert list(mute.packets(ours)) == []


def test_a_mute_over_tls(certificates: Certificates) -> None:
    with (
        Mute(context=tls(certificates.authority, certificates.server)) as broker,
        Client(broker.port, authority=certificates.authority, identity=certificates.observer) as client,
    ):
        client.publish("t", b"one", qos=1)


def test_a_mute_keeps_an_acknowledgement_back() -> None:
    with Mute(frozenset({mute.CONNACK})) as broker, connected(broker.port) as line:
        line.sendall(CONNECT)
        assert broker.next(mute.CONNECT).body[2:6] == b"MQTT"
        assert hears_nothing(line)


def test_a_mute_stops_reading() -> None:
    with Mute(reads=1) as broker, connected(broker.port) as line:
        line.sendall(CONNECT)
        assert line.recv(5) == bytes.fromhex("2003000000")
        line.setblocking(False)
        left = 64 << 20  # octets: more than any pair of buffers holds
        while left > 0 and select.select([], [line], [], SHORT)[1]:
            left -= line.send(mute.publication("t", bytes(1 << 20)))
        assert left > 0


@pytest.mark.parametrize(("option", "code"), [("connack", 0x87), ("suback", 0x87), ("puback", 0x97)])
def test_a_mute_refuses_by_code(option: str, code: int) -> None:
    asked = {
        "connack": b"",
        "suback": bytes.fromhex("8207000100000174") + b"\x01",
        "puback": bytes.fromhex("32060001740002") + b"\0",
    }[option]
    with Mute(**{option: code}) as broker, connected(broker.port) as line:
        line.sendall(CONNECT + asked)
        answers = line.recv(5) + (line.recv(100) if asked else b"")
        assert code in (answers if option == "connack" else answers[5:])
