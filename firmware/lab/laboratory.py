"""Test bench: two stations, their users, a recorder of frames."""

import json
import socket
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from pathlib import Path
from typing import Literal, NamedTuple

import zmq

import firmware
from board.runtime.errors import StationError
from board.runtime.free_udp import free_udp
from firmware.client import client
from firmware.client.received import Message, Pairing
from firmware.lab import netns, radio
from firmware.lab.broker import Broker
from firmware.lab.pcap import Pcap
from firmware.lab.program import Program
from firmware.untrusted import named, number, text, within

Link = Literal["udp", "veth", "radio", "devices", "none"]

HOST = "127.0.0.1"
GEONETWORKING = 0x8947
ETH_P_ALL = 3  # all protocols, from linux/if_ether.h: with the EtherType alone, outgoing frames are not seen
CABLE = ("captain-a", "captain-b")  # names of the cable's two ends
UP_S = 15.0
RECORD_BUFFER = 8 << 20  # octets of the recorder's receive buffer

# Messages that tshark decodes down to BTP only: a MAPEM of 8 octets with protocolVersion 9, and a VAM before Wireshark
# 4.4. They are (type, octets).
BESIDE = (("mapem", 8), ("vam", 34))

UDP = '[interfaces.air]\ndriver = "udp"\nframing = "ethernet"\nlisten = "{own}"\npeers = ["{recorder}", "{other}"]\n'
# Linux drops the first frame of an unknown 802.11p neighbour and only learns its address. Beacons are sent first, so
# that no message is dropped.
ETHERNET = '[interfaces.air]\ndriver = "ethernet"\ndevice = "{device}"\nbeacon_s = 0.5\n'


class Vector(NamedTuple):
    """Message of firmware/vectors.json."""

    type: str
    pdu: bytes
    is_beside: bool  # it is not one of the ten messages that the test counts for minutes

    @property
    def name(self) -> str:
        return f"{self.type} {len(self.pdu)}"


def vectors() -> list[Vector]:
    rows = json.loads((Path(firmware.__file__).parent / "vectors.json").read_bytes())
    return [Vector(row["type"], bytes.fromhex(row["hex"]), (row["type"], row["octets"]) in BESIDE) for row in rows]


class Seat:
    """User's program at one station: an XPUB socket, which sends like PUB, and a SUB socket."""

    def __init__(self, name: str, context: client.Context, place: client.Address, station: Program) -> None:
        self.name = name
        self.place = place
        self.station = station
        self.subscriber = client.subscribe(context, place, place.to_users, "")
        self._pairing = Pairing()
        self._publisher = context.socket(zmq.XPUB)
        self._publisher.set(zmq.SNDHWM, 0)
        self._publisher.connect(place.url(place.from_users))

    def join(self) -> None:
        """Wait until both sockets are connected in both directions: from then on no message is lost.

        Raises StationError if the station does not answer.
        """
        # First the station's subscription arrives; then a heartbeat shows that the station has the subscription of this
        # program.
        patience_ms = round(client.ANSWER_S * 1000)
        if not self._publisher.poll(patience_ms) or not self.subscriber.poll(patience_ms):
            raise StationError(f"station {self.name} does not answer its user")
        self._publisher.recv()

    def send(self, vector: Vector) -> None:
        self.send_pdu(vector.pdu)

    def send_pdu(self, pdu: bytes) -> None:
        self._publisher.send_multipart([b"v2x.", pdu])

    def receive(self) -> Iterator[Message]:
        """Yield the messages that have arrived, each with its `raw.` message."""
        for frames in client.waiting(self.subscriber):
            message = self._pairing.feed(frames)
            if message is not None:
                yield message


class Recorder:
    """Recorder of the bench: a socket that sees every frame, and a capture file."""

    def __init__(self, seeing: socket.socket, capture: Pcap | None) -> None:
        self.seeing = seeing
        self._capture = capture
        seeing.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECORD_BUFFER)
        seeing.setblocking(False)

    def fileno(self) -> int:
        return self.seeing.fileno()

    def record(self) -> None:
        """Write the frames that have arrived to the capture file."""
        while True:
            try:
                frame = self.seeing.recv(65536)
            except BlockingIOError:
                return
            if self._capture is not None and frame[12:14] == GEONETWORKING.to_bytes(2, "big"):
                self._capture.write(frame, time.time_ns())


class NamespaceDevice(NamedTuple):
    """Network device in a namespace of `ip netns`."""

    namespace: str
    name: str


class Bench(NamedTuple):
    """Running bench.

    seats     users' programs at stations A and B.
    recorder  recorder of the frames between them.
    radios    simulated radios of A and B; empty with another link.
    controls  control sockets of A and B.
    """

    seats: Sequence[Seat]
    recorder: Recorder
    radios: Sequence[radio.Radio] = ()
    controls: Sequence[Path] = ()

    def lost_on_air(self) -> int:
        return sum(one.lost() for one in self.radios)


@contextmanager
def bench(
    link: Link,
    loss: float,
    capture: Pcap | None,
    devices: Sequence[NamespaceDevice] = (),
    has_broker: bool = False,
    more: str = "",
) -> Iterator[Bench]:
    """Start stations, users and recorder; yield the bench once links are up and users have joined.

    loss        share of messages lost on the air between simulated radios.
    devices     two network devices that hear each other, for link `devices`.
    has_broker  connect the stations to a broker as well; not possible in separate namespaces.
    more        settings of both radios (drivers/sim/radio/settings.h).

    Raises StationError if anything is missing or does not start.
    """
    with ExitStack() as ending:
        folder = Path(ending.enter_context(tempfile.TemporaryDirectory(prefix="captain-lab-")))
        spaces: list[Callable[[], AbstractContextManager[None]]] = [nullcontext, nullcontext]
        radios: Sequence[radio.Radio] = ()
        environments: list[Mapping[str, str]] = [{}, {}]
        if link in ("veth", "devices"):
            names = [device.name for device in devices] or CABLE
            ends = [netns.named(device.namespace) for device in devices] or netns.cable(*CABLE)
            for end in ends:
                ending.callback(end.close)
            spaces = [end.inside for end in ends]
            with spaces[0]():
                seeing = ending.enter_context(_seeing(names[0]))
            boards = [ETHERNET.format(device=name) for name in names]
        else:
            seeing = ending.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
            seeing.bind((HOST, 0))
            recorder_port = seeing.getsockname()[1]
            if link == "radio":
                radios = radio.pair(HOST, recorder_port, loss, more)
                boards = [one.board for one in radios]
                environments = [one.environment for one in radios]
            else:
                boards = _udp_boards(recorder_port) if link == "udp" else ["", ""]
        if has_broker:
            broker = Broker(HOST, _port(ending), folder)
            ending.callback(broker.stop)
            boards = [f"{board}{broker.interface(f'lab-{name}')}" for name, board in zip("AB", boards, strict=True)]
        recorder = Recorder(seeing, capture)
        seats = []
        for name, space, board, environment in zip("AB", spaces, boards, environments, strict=True):
            with space():
                place = client.Address(HOST, *(_port(ending) for _ in range(4)))
                child = _station(name, board, place, folder, environment)
                ending.callback(child.stop)
                child.wait_until_ready()
                _wait_for_links(_control(folder, name), link)
                # The context's threads start with its first socket, so they run in the namespace of that moment.
                seats.append(Seat(name, ending.enter_context(client.session()), place, child))
        for seat in seats:
            seat.join()
            if link == "devices":
                _wait_for_neighbour(_control(folder, seat.name))
        yield Bench(seats, recorder, radios, [_control(folder, name) for name in "AB"])


def _seeing(device: str) -> socket.socket:
    """Return a socket that sees all frames of a network device in this namespace.

    Raises StationError if it is missing.
    """
    try:
        seeing = socket.socket(socket.AF_PACKET, socket.SOCK_RAW)
        seeing.bind((device, ETH_P_ALL))
    except OSError as error:
        raise StationError(f"network device {device}: {error.strerror}", "`ip -n NETNS link` lists them") from error
    return seeing


def _station(name: str, board: str, place: client.Address, folder: Path, environment: Mapping[str, str]) -> Program:
    options = {"station.name": f"lab-{name}", "endpoint.control": str(_control(folder, name))}
    options |= {f"endpoint.{key}": str(getattr(place, key)) for key in ("from_users", "to_users", "pull", "report")}
    given = ["run", "--board", "/dev/stdin", "--log", "warning"]
    for key, value in options.items():
        given += ["--set", f"{key}={value}"]
    return Program(f"station {name}", given, f'name = "lab"\n{board}'.encode(), environment)


def _control(folder: Path, name: str) -> Path:
    """Return the path of a station's control socket."""
    return folder / f"{name}.sock"


def _wait_for_links(control: Path, link: Link) -> None:
    def is_up(name: str, one: Mapping[str, object]) -> bool:
        is_whole = name != "air" or link != "radio" or radio.is_complete(within(one, "details"))
        return text(one, "state") == "up" and is_whole

    _wait_for(control, is_up, "the link did not come up")


def _wait_for_neighbour(control: Path) -> None:
    _wait_for(control, lambda name, one: number(one, "neighbours") > 0, "the other station is not heard")


def _wait_for(control: Path, is_so: Callable[[str, Mapping[str, object]], bool], failure: str) -> None:
    """Wait until a condition is true for each interface of a station. Raises StationError after UP_S."""
    deadline = time.monotonic() + UP_S
    while lacking := [one for one in named(client.station_status(control, UP_S), "interfaces") if not is_so(*one)]:
        if time.monotonic() > deadline:
            name, one = lacking[0]
            raise StationError(f"{failure}: {name}: {text(one, 'why')}")
        time.sleep(0.02)  # this waits in the command's own process, not in a station's loop


def _port(ending: ExitStack) -> int:
    """Return a TCP port that stays reserved until `ending` closes.

    It is bound without SO_REUSEADDR, so that no other program gets it. The option is set afterwards, so that a station
    can still bind and listen.
    """
    holder = ending.enter_context(socket.socket(socket.AF_INET, socket.SOCK_STREAM))
    holder.bind((HOST, 0))
    holder.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    return int(holder.getsockname()[1])


def _udp_boards(recorder: int) -> list[str]:
    a, b = free_udp(HOST, 2)
    return [UDP.format(own=own, other=other, recorder=f"{HOST}:{recorder}") for own, other in ((a, b), (b, a))]
