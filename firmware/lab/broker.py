"""Broker of the lab test: mosquitto with TLS and client certificates."""

import os
import shutil
import signal
import socket
import subprocess
import time
from pathlib import Path
from typing import IO

from board.runtime.child import die_with_parent
from board.runtime.errors import StationError
from firmware.lab.certificates import Authority
from firmware.lab.program import end

READY_S = 10.0
LOOK_S = 0.02

CONFIGURATION = """\
{user}persistence false
allow_anonymous true
set_tcp_nodelay true
log_dest stderr
log_type error
log_type warning
listener {port} {host}
cafile {ca}
certfile {server.certificate}
keyfile {server.key}
require_certificate true
"""
SERVER = "extendedKeyUsage=serverAuth\nsubjectAltName=IP:{host}\n"
CLIENT = "extendedKeyUsage=clientAuth\n"

INTERFACE = """\
[interfaces.v2n]
driver = "mqtt"
url = "mqtts://{host}:{port}"
client_id = "{name}"
ca = "{ca}"
certificate = "{own.certificate}"
key = "{own.key}"
"""


class Broker:
    """Running mosquitto with its files in a folder of its own. Raises StationError if it does not start."""

    def __init__(self, host: str, port: int, folder: Path) -> None:
        path = mosquitto()
        self._host, self._port = host, port
        self._authority = Authority(folder)
        server = self._authority.issue("broker", SERVER.format(host=host))
        file = folder / "mosquitto.conf"
        # Started by root, mosquitto would change to another user, who may not read the key.
        user = "user root\n" if os.geteuid() == 0 else ""
        ca = self._authority.certificate
        file.write_text(CONFIGURATION.format(user=user, host=host, port=port, ca=ca, server=server))
        self._said = (folder / "mosquitto.log").open("w+b")
        self._process = launch(path, file, self._said)
        self._wait_until_ready()

    def interface(self, name: str) -> str:
        """Return the interface's part of a board file for a station of this name, with a certificate of its own."""
        own = self._authority.issue(name, CLIENT)
        ca = self._authority.certificate
        return INTERFACE.format(host=self._host, port=self._port, name=name, ca=ca, own=own)

    def stop(self) -> None:
        """Stop the broker; kill it if it does not end within STOP_S."""
        end(self._process)
        self._said.close()

    def _wait_until_ready(self) -> None:
        deadline = time.monotonic() + READY_S
        while self._process.poll() is None and time.monotonic() < deadline:
            try:
                socket.create_connection((self._host, self._port), LOOK_S).close()
            except OSError:
                time.sleep(LOOK_S)  # this waits in the command's own process, not in a station's loop
            else:
                return
        self._said.seek(0)
        said = self._said.read().decode(errors="backslashreplace").strip() or "it said nothing"
        self.stop()
        raise StationError(f"mosquitto does not listen at {self._host}:{self._port}: {said}")


def mosquitto() -> str:
    """Return the path of mosquitto. Raises StationError if it is not installed."""
    found = shutil.which("mosquitto", path=os.pathsep.join((os.environ.get("PATH", os.defpath), "/usr/sbin")))
    if found is None:
        raise StationError("the program mosquitto is missing", "install the package mosquitto")
    return found


def launch(path: str, file: Path, said: IO[bytes] | int, number: int = signal.SIGTERM) -> "subprocess.Popen[bytes]":
    """Start mosquitto with a configuration file.

    said    file for its log.
    number  signal that it receives when this process ends.
    """
    return subprocess.Popen(
        [path, "-c", str(file)],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=said,
        start_new_session=True,
        preexec_fn=die_with_parent(number),  # noqa: PLW1509 (no thread of ours holds a lock)
    )
