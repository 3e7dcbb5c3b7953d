"""OCI image in network namespaces: two stations and a broker of compose.yaml exchange messages."""

import contextlib
import json
import os
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml

from image.errors import ImageError
from image.program import container
from image.tool import run
from tests.programs.debian import PROJECT
from tests.programs.wheels import CAM
from tests.proof.image.rows import Row

COMPOSED = container.FILES / "compose.yaml"
# crun of Debian 12 fails where cgroups have both versions; the proof needs none, so it sees none.
CRUN = [
    "unshare",
    "--mount",
    "sh",
    "-c",
    'mount -t tmpfs none /sys/fs/cgroup && exec crun --cgroup-manager=disabled "$@"',
    "crun",
]
MOST_S = 120.0  # until a message arrives; in emulation a station starts in 20 s
_SENT = """
import sys, time, zmq
socket = zmq.Context().socket(zmq.PUB)
socket.connect("tcp://127.0.0.1:5555")
while True:
    socket.send_multipart([b"v2x.cam.", bytes.fromhex(sys.argv[1])])
    time.sleep(0.2)
"""
_HEARD = """
import sys, zmq
socket = zmq.Context().socket(zmq.SUB)
socket.connect("tcp://127.0.0.1:5556")
socket.subscribe("v2x.cam.")
socket.poll(int(sys.argv[1])) and print(socket.recv_multipart()[-1].hex())
"""


def rows(archive: Path, folder: Path) -> Iterator[Row]:
    """Run both stations by the image's configuration, as compose.yaml changes it. Raises ImageError if a tool fails."""
    bundle = unpack(archive, folder)
    services = yaml.safe_load(COMPOSED.read_text())["services"]
    yield Row("OCI image", f"{archive.stat().st_size / 1e6:.1f} MB", "", True)
    with contextlib.ExitStack() as stack:
        names = {name: f"captain-{os.getpid()}-{name}" for name in services}
        _networks(names, stack)
        broker = ["mosquitto", "-c", str(container.FILES / "mosquitto.conf")]
        stack.enter_context(_started(["ip", "netns", "exec", names["broker"], *broker]))
        for name in ("a", "b"):
            place = configured(bundle, folder / name, services[name], Path("/run/netns") / names[name])
            command = [*CRUN, "run", "--bundle", str(place), names[name]]
            stack.callback(subprocess.run, ["crun", "delete", "--force", names[name]], capture_output=True, check=False)
            stack.enter_context(_started(command))
        for sender, receiver in (("a", "b"), ("b", "a")):
            yield _exchanged(sender, receiver, names)
        yield from _looked(names["a"], services["a"]["healthcheck"]["test"][1:])


def unpack(archive: Path, folder: Path) -> Path:
    """Unpack the image; return the folder with its configuration and root."""
    layout = folder / "layout"
    layout.mkdir()
    run(["tar", "--extract", "--file", archive, "--directory", layout])
    run(["umoci", "unpack", "--image", f"{layout}:{container.TAG}", folder / "bundle"])
    return folder / "bundle"


def configured(bundle: Path, target: Path, service: dict[str, Any], network: Path) -> Path:
    """Write a station's configuration: that of the image, with the changes of its service in compose.yaml."""
    config = json.loads((bundle / "config.json").read_text())
    config["root"] = {"path": str(bundle / "rootfs"), "readonly": service["read_only"]}
    config["hostname"] = service["hostname"]
    config["process"] |= {"terminal": False, "capabilities": {}}
    for one in config["linux"]["namespaces"]:
        if one["type"] == "network":
            one["path"] = str(network)
    target.mkdir()
    (target / "hosts").write_text(f"127.0.0.1 localhost\n{_address(service['hostname'], 1)} broker\n")
    binds = [(target / "hosts", "/etc/hosts")]
    for volume in service["volumes"]:
        source, place, _ = volume.split(":")
        binds.append((container.FILES / source, place))
    config["mounts"] += [_mount("bind", place, str(source.resolve()), "bind", "ro") for source, place in binds]
    for volume in service["tmpfs"]:
        place, _, options = volume.partition(":")
        config["mounts"].append(_mount("tmpfs", place, "tmpfs", *options.split(",")))
    (target / "config.json").write_text(json.dumps(config))
    return target


def _mount(kind: str, place: str, source: str, *options: str) -> dict[str, object]:
    return {"destination": place, "type": kind, "source": source, "options": list(options)}


def _networks(names: dict[str, str], stack: contextlib.ExitStack) -> None:
    """Make a network per service. Each station reaches the broker only."""
    for name in names.values():
        run(["ip", "netns", "add", name])
        stack.callback(run, ["ip", "netns", "delete", name])
        run(["ip", "-n", name, "link", "set", "lo", "up"])
    for station in ("a", "b"):
        ends = ((names["broker"], f"to-{station}", 1), (names[station], "eth0", 2))
        peer = ["peer", "name", "eth0", "netns", names[station]]
        run(["ip", "link", "add", f"to-{station}", "netns", names["broker"], "type", "veth", *peer])
        for network, device, number in ends:
            run(["ip", "-n", network, "address", "add", f"{_address(station, number)}/24", "dev", device])
            run(["ip", "-n", network, "link", "set", device, "up"])


def _address(station: str, number: int) -> str:
    return f"10.77.{ord(station)}.{number}"


@contextlib.contextmanager
def _started(words: list[str]) -> Iterator[None]:
    started = subprocess.Popen(
        words, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    try:
        yield
    finally:
        started.terminate()
        try:
            said = started.communicate(timeout=10)[0]
        except subprocess.TimeoutExpired:
            started.kill()
            said = started.communicate()[0]
        print(*said.strip().splitlines()[-5:], sep="\n", flush=True)


def _exchanged(sender: str, receiver: str, names: dict[str, str]) -> Row:
    """Send until the other station's user has received it."""
    python = str(PROJECT / ".venv/bin/python")
    inside = {name: ["ip", "netns", "exec", names[name], python, "-c"] for name in (sender, receiver)}
    began = time.monotonic()
    with _started([*inside[sender], _SENT, CAM]):
        heard = run([*inside[receiver], _HEARD, str(int(MOST_S * 1000))]).strip()
    seen = f"the same octets, {time.monotonic() - began:.1f} s" if heard == CAM else heard[:40] or "nothing"
    return Row(f"a CAM from {sender} to {receiver} by the broker", seen, "the same octets", heard == CAM)


def _looked(name: str, check: list[str]) -> Iterator[Row]:
    """Yield the health check of compose.yaml, and the user of the program."""
    try:
        said = run([*CRUN, "exec", name, *check]).strip().splitlines()
        yield Row(" ".join(check), f"{len(said)} lines", "exit code 0", bool(said))
    except ImageError as error:
        yield Row(" ".join(check), str(error), "exit code 0", False)
    process = json.loads(run(["crun", "state", name]))["pid"]
    user = Path(f"/proc/{process}").stat().st_uid
    yield Row("user of the station", str(user), str(container.USER), user == container.USER)
