"""MQTT by TLS after a start in 1970: V2N waits for a clock that is set, says so, and connects once it is."""

import json
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from drivers.mqtt.uplink import CLOCKLESS
from tests.broker.certificates import Authority
from tests.broker.mosquitto import Mosquitto
from tests.proof.image import ntp
from tests.proof.image.machine import NotSeenError, owned, powered
from tests.proof.image.root_shell import EXTRA, RootShell
from tests.proof.image.rows import Options, Row
from tests.proof.image.site import HOST
from tests.system.ports import Ports

SET_S = 300.0
CONFIGURATION = """\
[interfaces.v2n]
driver = "mqtt"
url = "mqtts://{host}:{port}"
client_id = "proof"
ca = "mqtt/ca.pem"
"""


def rows(card: Path, folder: Path, options: Options) -> Iterator[Row]:
    with ExitStack() as opened:
        ports = Ports()
        opened.callback(ports.release)
        authority = Authority(folder)
        server = authority.server((f"IP:{HOST}",))
        broker = opened.enter_context(Mosquitto(folder, ports, authority, server=server, require_certificate=False))
        files = {
            "captain.toml": CONFIGURATION.format(host=HOST, port=broker.port),
            "mqtt/ca.pem": authority.certificate.read_text(),
        }
        own = owned(card, folder, files)
        port = opened.enter_context(ntp.serving())
        shell = RootShell(folder)
        guest = opened.enter_context(powered(own, folder, [*shell.words, "-rtc", "base=1970-01-01T00:00:00"]))
        guest.stop_loader(EXTRA)
        shell.open()
        opened.callback(shell.close)
        yield from _waits(shell, broker)
        yield from _is_set(shell, broker, port)


def _waits(shell: RootShell, broker: Mosquitto) -> Iterator[Row]:
    shell.run("systemctl is-system-running --wait")
    date = shell.run("date -u +%F")
    found = _until(shell, lambda status: _v2n(status).get("why", "") == CLOCKLESS)
    said = f"{date}: {_v2n(found).get('state')}, {_v2n(found).get('why')}"
    yield Row("V2N after a start in 1970", said[:60], "down, waits for the clock", _v2n(found).get("why") == CLOCKLESS)
    is_set = found.get("is_clock_set")
    yield Row("is_clock_set", str(is_set).lower(), "false", is_set is False)
    tries = sum("New connection" in line for line in broker.log)
    yield Row("connections that the broker has seen meanwhile", str(tries), "0", tries == 0)


def _is_set(shell: RootShell, broker: Mosquitto, port: int) -> Iterator[Row]:
    said = shell.run(f"chronyc add server {HOST} port {port} iburst")
    yield Row("chronyd is given a server of the time", said, "200 OK", "200 OK" in said)
    began = time.monotonic()
    found = _until(shell, lambda status: bool(status.get("is_clock_set")))
    yield Row("is_clock_set, once it has set the clock", f"{str(found.get('is_clock_set')).lower()}, {time.monotonic() - began:.0f} s",
              "true", found.get("is_clock_set") is True)  # fmt: skip
    off_s = abs(int(shell.run("date +%s")) - time.time())
    yield Row("the clock is then off by", f"{off_s:.0f} s", "10", off_s < 10)
    found = _until(shell, lambda status: _v2n(status).get("state") == "up")
    yield Row("V2N by TLS, its certificate younger than the image", f"{_v2n(found).get('state')}: {_v2n(found).get('why')}"[:60],
              "up", _v2n(found).get("state") == "up")  # fmt: skip
    is_seen = any("as proof" in line for line in broker.log)
    yield Row("the broker has the client proof", "connected" if is_seen else "not seen", "connected", is_seen)


def _v2n(status: dict[str, Any]) -> dict[str, Any]:
    return dict(status.get("interfaces", {}).get("v2n", {}))


def _until(shell: RootShell, is_so: Any) -> dict[str, Any]:
    """The station's status as soon as it is so, or the last one."""
    ends = time.monotonic() + SET_S
    found: dict[str, Any] = {}
    while time.monotonic() < ends:
        try:
            found = json.loads(shell.run("captain status --json"))
        except (ValueError, NotSeenError):
            continue
        if is_so(found):
            break
        time.sleep(1)
    return found
