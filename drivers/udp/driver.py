"""Driver for UDP: options, sockets, and state of the link.

A datagram has a bare PDU (for tests on the bench), a BTP packet, or an Ethernet frame as Vanetza's tools send it.
"""

import socket
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from typing import Annotated, ClassVar, Literal

from board.netlink import DeviceWatch, NetworkDevice
from board.runtime.address import Address, address, check_device_name, is_ipv4
from board.runtime.describe import Range, all_of, at_key
from board.runtime.errors import ConfigurationError, InterfaceError, RequestError
from drivers.contract import BUSY, Can, Capabilities, Host, Sent, Shared
from drivers.message import Request
from drivers.packet.datagrams import sockaddr
from drivers.packet.geolink import GEONETWORKING_METADATA, GeoLink
from drivers.packet.intake import Intake, KernelDrops, enlarge, refused
from drivers.reason import Reason
from drivers.udp.framing import LANE_PROGRAMS, BtpFraming, Framing, PduFraming
from drivers.udp.sender import Sender, Target
from drivers.udp.sockets import group_address, open_group, open_sender, open_unicast

# Seconds for which the link's text reports an absent peer after its last ICMP error. UDP does not report its return.
ABSENT_S = 5.0

# Longest PDU and metadata of each framing; __init__() adds the abilities.
FRAMINGS = {
    "pdu": Capabilities(Can(0), "udp"),
    "btp": Capabilities(Can(0), "udp", metadata=frozenset({"btp_port"})),
    # A datagram is not limited by the frame length of a device, so PDUs may be longer than itsGnMaxSduSize.
    "ethernet": Capabilities(Can(0), "udp", metadata=GEONETWORKING_METADATA),
}


@dataclass(frozen=True)
class UdpOptions:
    """Messages in UDP datagrams.

    framing         content of a datagram. `pdu`: the PDU alone; `btp`: BTP-B and PDU; `ethernet`: Ethernet header,
                    GeoNetworking, BTP-B and PDU, as Vanetza's tools send at group 239.118.122.97:8947.
    listen          own address and port for unicast datagrams.
    peers           addresses and ports that each message is sent to.
    group           multicast group and port, for sending and receiving.
    device          network device of the group: its name or IPv4 address. The station watches a named one.
    receive_buffer  receive queue in the kernel for each message type; all types together may take 20 times as much.
                    Datagrams of a group share one queue.
    beacon_s        framing `ethernet`: a beacon is sent after this time without another packet. 0: no beacons.
    gn_version      framing `ethernet`: GeoNetworking protocol version of sent packets; this interface also accepts it.
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
        """Check the options. Raises ConfigurationError with a line for each mistake."""
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
    """Driver for facilities PDUs in UDP datagrams.

    address  address and port of the open unicast socket; None without one. If the option has port 0, this is the port
             that the kernel chose.
    """

    Options: ClassVar[type] = UdpOptions

    def __init__(self, options: UdpOptions, shared: Shared) -> None:
        hears = Can.RECEIVE if options.listen or options.group else Can(0)
        sends = Can.TRANSMIT if options.peers or options.group else Can(0)
        areas = Can.GEOBROADCAST if sends and options.framing == "ethernet" else Can(0)
        self.capabilities = FRAMINGS[options.framing]._replace(can=hears | sends | areas)
        self._options = options
        self._shared = shared
        self._sockets: _Sockets | None = None
        self.address: Address | None = None

    def start(self, host: Host) -> None:
        """Open the sockets.

        Raises InterfaceError if an address is in use, does not belong to this machine, or has no route.
        """
        try:
            self._sockets = _Sockets(self._options, self._shared, host)
        except OSError as error:
            raise refused(host.name, error) from error
        self.address = self._sockets.address
        if self.address is not None:
            host.report_details({"listen": str(self.address), "framing": self._options.framing})
        self._sockets.tell()

    def send(self, request: Request) -> Sent:
        sockets = self._sockets
        if sockets is None:
            return BUSY
        return sockets.sender.send(sockets.encode(request), request)

    def refresh(self) -> None:
        if self._sockets is not None:
            self._sockets.refresh()

    def stop(self) -> None:
        if self._sockets is not None:
            self._sockets.close()
            self._sockets = None


class _Sockets:
    """State between start() and stop(): the open sockets and their framing.

    address  same as Udp.address.

    Raises OSError or InterfaceError if a socket cannot be opened; all others are then closed again.
    """

    def __init__(self, options: UdpOptions, shared: Shared, host: Host) -> None:
        self._options = options
        self._shared = shared
        self._host = host
        self._drops: list[KernelDrops] = []
        self._notes: list[str] = []
        self._is_up = True
        self._absent_until: float | None = None
        self.address: Address | None = None
        targets = list(map(address, filter(None, (options.group, *options.peers))))
        with ExitStack() as opening:
            self._watch(opening)
            opened = [Target(to, opening.enter_context(open_sender(to, options.device))) for to in targets]
            self.sender = Sender(host, opened, self._is_absent)
            opening.callback(self.sender.close)
            framing = self._framing()
            opening.callback(framing.stop)
            self.encode = framing.encode if opened else self._nowhere
            if options.listen:
                self._listen(opening, framing)
            if options.group:
                receiver = opening.enter_context(open_group(address(options.group), options.device))
                self._take(opening, receiver, framing).own = sockaddr(opened[0].socket.getsockname())
            framing.start()
            self._opened = opening.pop_all()

    def refresh(self) -> None:
        self._count_drops()
        if self._absent_until is not None and self._host.loop.clock() > self._absent_until:
            self._absent_until = None
            self.tell()

    def close(self) -> None:
        self._count_drops()
        self._is_up = False
        self._opened.close()

    def _watch(self, opening: ExitStack) -> None:
        options = self._options
        if options.device and not is_ipv4(options.device):
            watch = DeviceWatch(self._host.loop, options.device, self._changed)
            opening.callback(watch.close)
            self._is_up = watch.state is not None and watch.state.is_usable

    def _listen(self, opening: ExitStack, framing: Framing) -> None:
        options, lanes = self._options, self._shared.lanes
        program = LANE_PROGRAMS[options.framing](lanes)
        sockets = open_unicast(address(options.listen), len(lanes) + 1, program)
        self.address = Address(*sockets[0].getsockname())
        urgent: Intake | None = None
        for one in [opening.enter_context(one) for one in sockets]:
            intake = self._take(opening, one, framing, urgent)
            urgent = urgent or intake

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
        return self.sender.send(octets) if self._is_up else None

    def _broken(self, error: OSError) -> None:
        self._host.fail(refused("receiving", error))

    def _changed(self, device: NetworkDevice | None) -> None:
        if device is None:
            self._host.fail(InterfaceError(f"network device {self._options.device} is gone"))
            return
        self._is_up = device.is_usable
        self.tell()

    def _is_absent(self, to: Address) -> None:
        is_news = self._absent_until is None
        self._absent_until = self._host.loop.clock() + ABSENT_S
        if is_news:
            self._host.link(True, f"{to} refuses: no program listens there")

    def tell(self) -> None:
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
