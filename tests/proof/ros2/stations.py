"""Stations and gateways as programs of their own, with a message of each type."""

import contextlib
import importlib.util
import json
import os
import signal
import subprocess
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

from asn1.model import text
from tests.asn1.values import Values
from tests.firmware.gateway import real
from tests.proof.ros2 import ros
from tests.proof.ros2.ros import RosError
from tests.system.ports import Ports
from tests.system.station import Station

GATEWAY = ros.ROOT / "firmware" / "gateway" / "captain_gateway"
STOP_S = 15.0
# The handlers that the lab test has: ten types of message.
TYPES = {
    "cam": "cam-1.4.1", "denm": "denm-1.3.1", "cpm": "cpm-2.1.1", "vam": "vam-2.1.1", "ivim": "ivim-2.1.1",
    "mapem": "mapem-2.1.1", "spatem": "spatem-2.1.1", "srem": "srem-2.1.1", "ssem": "ssem-2.1.1",
    "rtcmem": "rtcmem-2.1.1",
}  # fmt: skip
REAL = {
    "cam": real.CAM, "denm": real.real("denm", 43), "vam": real.real("vam", 34), "ivim": real.IVIM,
    "mapem": real.MAPEM, "spatem": real.SPATEM,
}  # fmt: skip
LONGEST_S = 600.0  # of a script
LONGEST = 400  # of a made message, octets
MADE = 200


def load(codec: Path) -> ModuleType:
    """The message library of a folder, beside the one that the station has, which knows nothing of ROS."""
    [path] = codec.glob("captain_messages.*.so")
    spec = importlib.util.spec_from_file_location("captain_messages", path)
    assert spec is not None
    assert spec.loader is not None
    made = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(made)
    return made


def messages(codec: Path, handlers: Sequence[str]) -> dict[str, bytes]:
    """One for each handler: a real one, else the longest of some made ones, of which nothing is left out."""
    library = load(codec)
    schema = text.load_schema()
    found = {handler: REAL[handler] for handler in handlers if handler in REAL}
    for handler in handlers:
        if handler in REAL:
            continue
        message = library.find(TYPES[handler])
        values = Values(schema, schema.messages[message.name].pdu, seed=1, knows_more=False, is_long=False)
        head = bytes((message.versions[-1], message.ids[0]))
        made = [head + message.encode(values.value())[2:] for _ in range(MADE)]
        found[handler] = max((one for one in made if len(one) < LONGEST and not message.to_cdr(one)[1]), key=len)
    return {handler: found[handler] for handler in handlers}


@contextlib.contextmanager
def pair() -> Iterator[tuple[Station, Station]]:
    """Two stations that hear each other by UDP."""
    ports = Ports()
    with tempfile.TemporaryDirectory(prefix="captain-ros2-", dir=ros.MADE) as folder:
        stations = []
        for name in "ab":
            (Path(folder) / name).mkdir()
            stations.append(Station(Path(folder) / name, ports))
        air = [ports.take(), ports.take()]
        try:
            for place, (station, name) in enumerate(zip(stations, "ab", strict=True)):
                own, other = (f"127.0.0.1:{air[place ^ turn]}" for turn in (0, 1))
                udp = {"driver": "udp", "framing": "ethernet", "listen": own, "peers": [other], "queue": 4096}
                station.configure(
                    {"air": udp},
                    station={
                        "name": name, "mac": f"02:00:00:00:00:0{place + 1}", "type": 5,
                        "position": {"latitude": 47.0585, "longitude": 15.46},
                    },
                )  # fmt: skip
                station.start()
            yield stations[0], stations[1]
        finally:
            for station in stations:
                station.kill()
            ports.release()


def environment(codec: Path, prefix: Path = ros.INSTALLED) -> dict[str, str]:
    """Of a program of ROS that finds the message library and the gateway; the one is not installed there."""
    found = ros.environment(prefix)
    found["PYTHONPATH"] += f":{codec}:{GATEWAY}"
    return found | {"PYTHONUNBUFFERED": "1"}


def endpoint(ports: Mapping[str, int]) -> list[str]:
    """Parameters of a gateway that name the ports of a station."""
    return [word for name, port in ports.items() for word in ("-p", f"station.{name}:={port}")]


@contextlib.contextmanager
def played() -> Iterator[dict[str, int]]:
    """Ports, by name, for a station that a script plays."""
    held = Ports()
    try:
        yield {name: held.take() for name in ("to_users", "report", "pull", "from_users")}
    finally:
        held.release()


class Node:
    """A gateway, or another program of ROS, until the end of a with; what it says goes to a file."""

    def __init__(self, words: list[str | Path], environment: Mapping[str, str], log: Path) -> None:
        self.log = log
        if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # in a shell's background; a child would do the same
            signal.signal(signal.SIGINT, signal.default_int_handler)
        with log.open("wb") as said:
            self._child = subprocess.Popen(
                [str(word) for word in words], env=dict(environment), stdout=said, stderr=said
            )

    def __enter__(self) -> "Node":
        return self

    def __exit__(self, *error: object) -> None:
        if self._child.poll() is None:
            self._child.send_signal(signal.SIGINT)
            try:
                self._child.wait(STOP_S)
            except subprocess.TimeoutExpired:
                self._child.kill()
                self._child.wait()
                raise RosError(f"it did not end on SIGINT: {self.said[-2000:]}") from None

    @property
    def pid(self) -> int:
        return self._child.pid

    @property
    def is_running(self) -> bool:
        return self._child.poll() is None

    @property
    def said(self) -> str:
        return self.log.read_text(errors="replace")

    def processor_s(self) -> float:
        """Seconds of a processor that it has used: utime and stime of proc(5)."""
        fields = Path(f"/proc/{self.pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def gateway(codec: Path, ports: Mapping[str, int], log: Path, prefix: Path, *words: str) -> Node:
    """A gateway to a station with these ports, from the sources. words: of ROS, as `-p name:=value`."""
    command: list[str | Path] = [ros.ENV / "bin" / "python", "-m", "captain_gateway", "--ros-args"]
    return Node([*command, *endpoint(ports), *words], environment(codec, prefix), log)


def inside(script: str, *words: str | Path, codec: Path, prefix: Path) -> Any:
    """What a script of tests/proof/ros2/inside has found, as JSON on its last line. Raises RosError."""
    command = [str(ros.ENV / "bin" / "python"), str(ros.INSIDE / script), *map(str, words)]
    ended = subprocess.run(
        command, env=environment(codec, prefix), text=True, capture_output=True, check=False, timeout=LONGEST_S
    )
    if ended.returncode:
        raise RosError(f"{script}: {(ended.stdout + ended.stderr)[-3000:]}")
    return json.loads(ended.stdout.splitlines()[-1])
