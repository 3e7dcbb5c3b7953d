"""Line between paho-mqtt and a socket: behaviour when the connection ends."""

import select
import socket
import ssl
from threading import Thread

import pytest

from drivers.mqtt.client.line import BrokerLine
from tests.broker.bad import tls
from tests.broker.fixtures import certificates

__all__ = ["certificates"]

PATIENCE_S = 5.0  # reached only by a test that fails


def test_after_the_last_word_what_the_broker_sends_by_tls_is_discarded(certificates) -> None:
    near, far = socket.socketpair()
    of_client = ssl.create_default_context(cafile=certificates.authority.certificate)
    of_client.load_cert_chain(certificates.client.certificate, certificates.client.key)
    of_server = tls(certificates.authority, certificates.server)

    def serve() -> None:
        with of_server.wrap_socket(far, server_side=True) as broker:
            assert broker.recv(1000) == b"bye"
            broker.sendall(b"\x30\xff\xff\xff\xff\xff what another station said meanwhile")

    broker = Thread(target=serve)
    broker.start()
    client = of_client.wrap_socket(near, server_hostname="localhost")
    client.setblocking(False)
    line = BrokerLine(client)
    line.send(b"bye")
    line.shut()
    with pytest.raises(EOFError):
        skip_all(line)
    line.end()
    broker.join()


def skip_all(line: BrokerLine) -> None:
    while select.select([line.fileno()], [], [], PATIENCE_S)[0]:
        line.skip()
