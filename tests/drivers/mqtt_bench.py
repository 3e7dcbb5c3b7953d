"""Bench of the driver mqtt: a real broker with TLS and a second client."""

import atexit
import os
import shutil
import signal
import sys
import tempfile
from base64 import b64decode, b64encode
from functools import cache
from pathlib import Path

from drivers.contract import Can, Driver
from drivers.mqtt.driver import Mqtt
from drivers.mqtt.options import MqttOptions
from firmware.lab.certificates import Pair
from tests.broker.certificates import Authority
from tests.broker.client import Client
from tests.broker.mosquitto import Mosquitto
from tests.drivers.bench import Bench
from tests.drivers.host import SHARED, request
from tests.system.ports import Ports
from tests.virtual import VirtualLoop

MQTT_PROGRAM = [sys.executable, "-P", str(Path(__file__).parent / "mqtt/program.py")]


@cache
def _identities() -> tuple[Authority, Pair, Pair, Pair]:
    """Return a certificate authority, and the certificates and keys of broker, station and other end."""
    folder = tempfile.mkdtemp(prefix="captain-bench-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    authority = Authority(Path(folder))
    return authority, authority.server(), authority.client("bench"), authority.client("other")


class MqttBench(Bench):
    """Bench with a real broker with TLS, a second client, and the authority's certificate, which can be removed."""

    patience_s = 20.0  # a process has to start
    can = Bench.can | Can.ANYWHERE
    has_process = True
    is_brought_up = True

    def __init__(self, loop: VirtualLoop, folder: Path) -> None:
        loop.patience_s = 0.5  # for the process to answer
        self._authority, server, own, self._other = _identities()
        ports = Ports()
        self._broker = Mosquitto(folder, ports, self._authority, server=server)
        ports.release()  # not needed: the test has a network namespace of its own
        self._client: Client | None = None
        self._ca = folder / "ca.pem"
        options = MqttOptions(
            url=self._broker.url, client_id="bench", ca=str(self._ca), certificate=str(own.certificate), key=str(own.key)
        )  # fmt: skip
        # The driver must accept a long silence of its process, because virtual hours of a test take microseconds.
        self._mqtt = Mqtt(options, SHARED._replace(types=("cam", "denm")), MQTT_PROGRAM, silence_s=0.0)
        self.driver: Driver = self._mqtt

    def plug(self) -> None:
        self._ca.symlink_to(self._authority.certificate)
        self._broker.start()
        self._client = Client(self._broker.port, "other", authority=self._authority, identity=self._other)
        self._client.subscribe("v2x/btp/+", no_local=True)

    def unplug(self) -> None:
        self._ca.unlink()
        assert self._mqtt._uplink is not None
        worker = self._mqtt._uplink._worker
        assert worker is not None
        assert worker._child is not None
        os.kill(worker._child._process.pid, signal.SIGKILL)
        self.close()

    def close(self) -> None:
        if self._client is not None:
            self._client.close()
            self._client = None
        self._broker.stop()

    def say(self, pdu: bytes) -> None:
        assert self._client is not None
        port = request(pdu).btp_port
        self._client.publish(f"v2x/btp/{port}", b"other(%d): <%s>" % (port, b64encode(pdu)))

    def heard(self) -> list[bytes]:
        assert self._client is not None
        found = []
        while not self._client.messages.empty():
            payload = self._client.messages.get().payload
            found.append(b64decode(payload[payload.index(b"<") + 1 : -1]))
        return found
