"""Network devices for tests: the driver's device v2x0 and its other end, air0."""

import json
import socket
import subprocess
from pathlib import Path

from board.netlink import device
from drivers.ethernet import Ethernet, EthernetOptions
from tests.drivers.host import SHARED

CAPTURES = json.loads((Path(__file__).parents[1] / "captures" / "frames.json").read_text())
FRAMES = {frame["name"]: bytes.fromhex(frame["hex"]) for frame in CAPTURES["frames"]}
CAM_FRAME = FRAMES["cam-shb"]
DENM_FRAME = CAM_FRAME[:54] + bytes.fromhex("07d200000201") + CAM_FRAME[60:]
PDU = CAM_FRAME[58:]


def ip(command: str) -> None:
    subprocess.run(["ip", *command.split()], check=True)


def wait_for_carrier(*names: str) -> None:
    """Wait until new network devices have a carrier, which the kernel reports by netlink a moment later."""
    with socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, 0) as news:
        news.bind((0, 1))
        news.settimeout(2)
        while not all((found := device(name)) and found.is_usable for name in names):
            news.recv(4096)


def veth():
    ip("link add v2x0 type veth peer name air0")
    ip("link set v2x0 up")
    ip("link set air0 up")
    wait_for_carrier("v2x0", "air0")


def air():
    """Return a socket at the other end of the veth pair, which receives frames of any EtherType."""
    air = socket.socket(socket.AF_PACKET, socket.SOCK_RAW | socket.SOCK_NONBLOCK, socket.htons(0x8947))
    air.bind(("air0", 0x8947))
    return air


def started(host, shared=SHARED, **options):
    driver = Ethernet(EthernetOptions(**{"device": "v2x0", "beacon_s": 0.0, **options}), shared)
    driver.start(host)
    return driver
