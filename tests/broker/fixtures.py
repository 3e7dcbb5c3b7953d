"""Brokers and their certificates for tests; a conftest imports those that its tests use."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from firmware.lab.certificates import Pair
from tests.broker.bad import FullBacklog, Listener
from tests.broker.certificates import Authority
from tests.broker.client import Client
from tests.broker.mosquitto import Mosquitto
from tests.broker.names import SilentNames
from tests.broker.proxy import Proxy
from tests.system.ports import Ports


class Certificates:
    """Made once, since none is ever changed: of an authority, and of one that nobody knows."""

    def __init__(self, folder: Path) -> None:
        self.authority = Authority(folder)
        self.stranger = Authority(folder, "stranger")
        self.server = self.authority.server()
        self.expired_server = self.authority.server(is_expired=True)
        self.other_server = self.authority.server(("DNS:other.example",))
        self.strange_server = self.stranger.server()
        self.client = self.authority.client("vm")
        self.observer = self.authority.client("observer")
        self.expired_client = self.authority.client("vm", is_expired=True)
        self.strange_client = self.stranger.client("vm")


class Brokers:
    """Starts brokers, clients and networks, and ends them all."""

    def __init__(self, folder: Callable[[], Path], certificates: Certificates) -> None:
        self.certificates = certificates
        self._folder = folder
        self._ports = Ports()
        self._closing = ExitStack()
        self._closing.callback(self._ports.release)

    def __call__(self, **how: Any) -> Mosquitto:
        """A running broker: the words of Mosquitto."""
        return self.stopped(**how).start()

    def stopped(self, **how: Any) -> Mosquitto:
        """One that is not started yet."""
        how.setdefault("server", self.certificates.server)
        broker = Mosquitto(self._folder(), self._ports, self.certificates.authority, **how)
        self._closing.callback(broker.stop)
        return broker

    def client(self, broker: Mosquitto, name: str = "observer", **how: Any) -> Client:
        """A connected client, over TLS with a certificate: the words of Client."""
        identity: Pair = how.pop("identity", self.certificates.observer)
        client = Client(broker.port, name, authority=broker.authority, identity=identity, **how)
        self._closing.callback(client.close)
        return client

    def proxy(self, broker: Mosquitto, **how: Any) -> Proxy:
        """A running network in front of its TLS listener: the words of Proxy."""
        return self._closing.enter_context(Proxy(broker.port, **how))

    def keep(self, listener: Any) -> Any:
        """A Listener, FullBacklog or another context manager, which is ended with the rest."""
        assert isinstance(listener, Listener | FullBacklog | SilentNames)
        return self._closing.enter_context(listener)

    def close(self) -> None:
        self._closing.close()


@pytest.fixture(scope="session")
def certificates(tmp_path_factory: pytest.TempPathFactory) -> Certificates:
    return Certificates(tmp_path_factory.mktemp("certificates"))


@pytest.fixture
def brokers(tmp_path_factory: pytest.TempPathFactory, certificates: Certificates) -> Iterator[Brokers]:
    """Brokers of one test."""
    made = Brokers(lambda: tmp_path_factory.mktemp("broker"), certificates)
    yield made
    made.close()


@pytest.fixture(scope="module")
def brokers_shared(tmp_path_factory: pytest.TempPathFactory, certificates: Certificates) -> Iterator[Brokers]:
    """Brokers of the tests of a module."""
    made = Brokers(lambda: tmp_path_factory.mktemp("broker"), certificates)
    yield made
    made.close()
