"""UDP as an interface: bare PDUs for bench work, BTP, or whole Ethernet frames as Vanetza's tools send them."""

import socket
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from typing import Annotated, ClassVar, Literal

from board.address import Address, address, check_device_name, is_ipv4
from board.describe import Range, all_of, at_key
from board.errors import ConfigurationError, InterfaceError, RequestError
from board.netlink import Device, DeviceWatch
from drivers.contract import Can, Capabilities, Host, Sent, Shared
from drivers.datagrams import sockaddr
from drivers.geolink import GEONETWORKING_METADATA, GeoLink
from drivers.intake import Intake, KernelDrops, enlarge, refused
from drivers.message import Request
from drivers.reason import Reason
from drivers.udp_framing import LANE_PROGRAMS, BtpFraming, Framing, PduFraming
from drivers.udp_sender import Sender, Target
from drivers.udp_socket import group_address, open_group, open_sender, open_unicast

# How long the link's text speaks of an absent peer after the last sign of its absence. UDP gives no sign of return.
ABSENT_S = 5.0

# What each framing carries and tells.
FRAMINGS = {
    "pdu": Capabilities(Can(0), "udp"),
    "btp": Capabilities(Can(0), "udp", metadata=frozenset({"btp_port"})),
    # No device's frame is the limit here, so the longest PDU passes, itsGnMaxSduSize or not.
    "ethernet": Capabilities(Can(0), "udp", metadata=GEONETWORKING_METADATA),
}


@dataclass(frozen=True)
class UdpOptions:
    """Options of an interface with driver = "udp".

    framing         pdu: the PDU and nothing else. btp: a BTP-B header before it. ethernet: an Ethernet header,
                    GeoNetworking and BTP-B before it; Vanetza's tools speak that at group 239.118.122.97:8947.
    listen          address and port of our own, for datagrams to this host alone.
    peers           addresses and ports that each message is sent to.
    group           multicast group and port that is heard, and that each message is sent to.
    device          name or IPv4 address of the group's network device; a named one is watched.
    receive_buffer  octets that the kernel keeps while the station is busy, of each message type: all types together
                    may take that much some twenty times. A group's datagrams share one queue.
    beacon_s        framing ethernet: seconds without a packet of ours until a beacon; 0 for none.
    gn_version      framing ethernet: GeoNetworking protocol version of what is sent; it is accepted as well.
    """

    framing: Literal["pdu", "btp", "ethernet"] = "ethernet"
    listen: str = ""
    peers: tuple[str, ...] = ()
    group: str = ""
    device: str = ""
    receive_buffer: Annotated[int, Range(2048, 268_435_456)] = 4_194_304
    beacon_s: Annotated[float, Range(0.0, 3600.0)] = 3.0
    gn_version: Annotated[int, Range(0, 1)] = 1

    def __post_init__(self) -> None:
        """Raises ConfigurationError with a line for each mistake."""
        texts = [("listen", address, self.listen), *(("peers", address, peer) for peer in self.peers)]
        texts += [("group", group_address, self.group)]
        checks = [partial(at_key, *one) for one in texts if one[-1]]
        if self.device and not is_ipv4(self.device):
            checks.append(partial(at_key, "device", check_device_name, self.device))
        all_of([*checks, self._check_ways])

    def _check_ways(self) -> None:
        if not (self.listen or self.group or self.peers):
            raise ConfigurationError("a udp interface has neither listen nor group nor peers", "give one of them")


class Udp:
    """Facilities PDUs in UDP datagrams."""

    Options: ClassVar[type] = UdpOptions

    def __init__(self, options: UdpOptions, shared: Shared) -> None:
        hears = Can.RECEIVE if options.listen or options.group else Can(0)
        sends = Can.TRANSMIT if options.peers or options.group else Can(0)
        areas = Can.GEOBROADCAST if sends and options.framing == "ethernet" else Can(0)
        self.capabilities = FRAMINGS[options.framing]._replace(can=hears | sends | areas)
        self._options = options
        self._shared = shared
        self._opened = ExitStack()
        self._drops: list[KernelDrops] = []
        self._notes: list[str] = []
        self._is_up = False
        self._absent_until: float | None = None
        self.address: Address | None = None  # that is listened at: port 0 of an option is another one here

    def start(self, host: Host) -> None:
        self._host = host
        self._is_up = True
        with ExitStack() as opening:
            # Whoever closes the sockets, a stop or a start that fails half-way, forgets what was known of them.
            opening.callback(self._forget)
            try:
                self._open(opening)
            except OSError as error:
                raise refused(host.name, error) from error
            self._opened = opening.pop_all()
        if self.address is not None:
            host.tell({"listen": str(self.address), "framing": self._options.framing})
        self._tell()

    def send(self, request: Request) -> Sent:
        return self._sender.send(self._encode(request), request)

    def refresh(self) -> None:
        self._count_drops()
        if self._absent_until is not None and self._host.loop.clock() > self._absent_until:
            self._absent_until = None
            self._tell()

    def stop(self) -> None:
        self._count_drops()
        self._opened.close()

    def _forget(self) -> None:
        self._drops, self._notes = [], []
        self._is_up = False
        self._absent_until = None

    def _open(self, opening: ExitStack) -> None:
        options = self._options
        if options.device and not is_ipv4(options.device):
            watch = DeviceWatch(self._host.loop, options.device, self._changed)
            opening.callback(watch.close)
            self._is_up = watch.state is not None and watch.state.is_usable
        targets = [
            Target(to, opening.enter_context(open_sender(to, options.device)))
            for to in map(address, filter(None, (options.group, *options.peers)))
        ]
        self._sender = Sender(self._host, targets, self._is_absent)
        opening.callback(self._sender.close)
        framing = self._framing()
        opening.callback(framing.stop)
        self._encode = framing.encode if targets else self._nowhere
        if options.listen:
            lanes = self._shared.lanes
            program = LANE_PROGRAMS[options.framing](lanes)
            sockets = open_unicast(address(options.listen), len(lanes) + 1, program)
            self.address = Address(*sockets[0].getsockname())
            urgent: Intake | None = None
            for one in [opening.enter_context(one) for one in sockets]:
                intake = self._take(opening, one, framing, urgent)
                urgent = urgent or intake
        if options.group:
            receiver = opening.enter_context(open_group(address(options.group), options.device))
            self._take(opening, receiver, framing).own = sockaddr(targets[0].socket.getsockname())
        framing.start()

    def _framing(self) -> Framing:
        host, shared, options = self._host, self._shared, self._options
        if options.framing == "pdu":
            return PduFraming(host)
        if options.framing == "btp":
            return BtpFraming(host, shared)
        return GeoLink(host, shared, shared.mac, options.beacon_s, self._beacon, options.gn_version)

    def _take(
        self, opening: ExitStack, receiver: socket.socket, framing: Framing, urgent: Intake | None = None
    ) -> Intake:
        note = enlarge(receiver, self._options.receive_buffer)
        if note and note not in self._notes:
            self._notes.append(note)
        intake = Intake(self._host, receiver, framing.receive, self._broken, urgent)
        opening.callback(intake.close)
        self._drops.append(KernelDrops(receiver))
        return intake

    def _count_drops(self) -> None:
        for drops in self._drops:
            count = drops.take()
            if count:
                self._host.drop(Reason.KERNEL_QUEUE, count=count)

    def _nowhere(self, request: Request) -> bytes:
        raise RequestError(f"{self._host.name} only listens", "give it peers or a group to send to")

    def _beacon(self, octets: bytes) -> Sent | None:
        return self._sender.send(octets) if self._is_up else None

    def _broken(self, error: OSError) -> None:
        self._host.fail(refused("receiving", error))

    def _changed(self, device: Device | None) -> None:
        if device is None:
            self._host.fail(InterfaceError(f"network device {self._options.device} is gone"))
            return
        self._is_up = device.is_usable
        self._tell()

    def _is_absent(self, to: Address) -> None:
        is_news = self._absent_until is None
        self._absent_until = self._host.loop.clock() + ABSENT_S
        if is_news:
            self._host.link(True, f"{to} refuses: nobody listens there")

    def _tell(self) -> None:
        if self._is_up:
            self._host.link(True, self._text())
        else:
            self._host.link(False, f"network device {self._options.device} is down or has no carrier")

    def _text(self) -> str:
        options = self._options
        parts = [f"listens at {self.address}" if options.listen else ""]
        if options.group:
            parts.append(f"group {options.group}" + (f" by {options.device}" if options.device else ""))
        if options.peers:
            parts.append(f"sends to {', '.join(options.peers)}")
        return "; ".join(filter(None, [*parts, *self._notes]))
