"""GeoNetworking on a network device, EtherType 0x8947: 802.11p in OCB mode, or any wire."""

import errno
import socket
import struct
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from typing import Annotated, ClassVar

from board.address import check_device_name, mac_address
from board.describe import Range, all_of, at_key
from board.errors import InterfaceError, RequestError
from board.loop import Timer
from board.netlink import Device, DeviceWatch
from drivers.access_category import BEACON, NEW_SOCKET, prioritize_frames
from drivers.contract import BUSY, NOW, Can, Capabilities, Host, Sent, Shared
from drivers.geolink import GEONETWORKING_METADATA, MAX_PAYLOAD, GeoLink
from drivers.intake import Intake, enlarge, not_permitted, refused
from drivers.lanes import ALL, NONE, NOT_FOR_OTHERS, SOL_PACKET, fan_out, in_packet, keep
from drivers.message import NO_MAC, Request
from drivers.reason import Reason

ETHERTYPE = 0x8947
# linux/if_packet.h
PACKET_ADD_MEMBERSHIP = 1
PACKET_STATISTICS = 6
PACKET_MR_PROMISC = 1

# The queue of the device is full, and no event tells when there is room again: ask after this time.
NO_ROOM = frozenset({errno.ENOBUFS, errno.EAGAIN, errno.ENOMEM})
NO_ROOM_S = 0.005


@dataclass(frozen=True)
class EthernetOptions:
    """Options of an interface with driver = "ethernet".

    device          name of the network device.
    mac             own address as 02:00:00:00:00:0b; empty: the device's.
    promiscuous     take frames to other stations' addresses as well.
    receive_buffer  octets that the kernel keeps while the station is busy, of each message type: all types together
                    may take that much some twenty times.
    beacon_s        seconds without a packet of ours until a beacon; 0 for none.
    gn_version      GeoNetworking protocol version of what is sent; it is accepted as well.
    """

    device: str
    mac: str = ""
    promiscuous: bool = False
    receive_buffer: Annotated[int, Range(2048, 268_435_456)] = 4_194_304
    beacon_s: Annotated[float, Range(0.0, 3600.0)] = 3.0
    gn_version: Annotated[int, Range(0, 1)] = 1

    def __post_init__(self) -> None:
        """Raises ConfigurationError with a line for each mistake."""
        checks = [partial(at_key, "device", check_device_name, self.device)]
        if self.mac:
            checks.append(partial(at_key, "mac", mac_address, self.mac))
        all_of(checks)


def _socket() -> socket.socket:
    # Protocol 0 takes nothing until the socket is bound to another. Of one that is bound to a protocol the kernel
    # keeps what leaves by the device, so own frames do not come back.
    return socket.socket(socket.AF_PACKET, socket.SOCK_RAW | socket.SOCK_NONBLOCK, 0)


class Ethernet:
    """GeoNetworking packets in Ethernet frames of one network device."""

    Options: ClassVar[type] = EthernetOptions
    capabilities: ClassVar[Capabilities] = Capabilities(
        Can.RECEIVE | Can.TRANSMIT | Can.GEOBROADCAST, "ethernet", MAX_PAYLOAD, GEONETWORKING_METADATA
    )

    def __init__(self, options: EthernetOptions, shared: Shared) -> None:
        self._options = options
        self._shared = shared
        self._opened = ExitStack()
        self._sockets: list[socket.socket] = []
        self._room_timer: Timer | None = None
        self._is_up = False
        self._notes = ""

    def start(self, host: Host) -> None:
        self._host = host
        with ExitStack() as opening:
            try:
                self._open(opening)
            except PermissionError as error:
                raise not_permitted(self._options.device) from error
            except OSError as error:
                raise refused(self._options.device, error) from error
            self._opened = opening.pop_all()
        self._tell()

    def send(self, request: Request) -> Sent:
        return self._transmit(self._link.encode(request), request.traffic_class)

    def refresh(self) -> None:
        for one in self._sockets:
            # struct tpacket_stats: packets, drops. Reading sets both to 0. What a filter rejects is in neither.
            statistics = one.getsockopt(SOL_PACKET, PACKET_STATISTICS, 8)
            drops = struct.unpack("=II", statistics)[1]
            if drops:
                self._host.drop(Reason.KERNEL_QUEUE, count=drops)

    def stop(self) -> None:
        self.refresh()
        self._sockets = []
        self._is_up = False
        self._opened.close()
        if self._room_timer is not None:
            self._room_timer.cancel()
            self._room_timer = None

    def _open(self, opening: ExitStack) -> None:
        options = self._options
        self._watch = DeviceWatch(self._host.loop, options.device, self._changed)
        opening.callback(self._watch.close)
        device = self._watch.state
        if device is None:
            raise InterfaceError(f"{options.device}: no such network device", "`ip link` lists them")
        self._is_up = device.is_usable
        shared = self._own(device)
        self._link = GeoLink(self._host, shared, shared.mac, options.beacon_s, self._beacon, options.gn_version)
        opening.callback(self._link.stop)
        self._transmitter = opening.enter_context(_socket())
        self._transmitter.bind((options.device, 0))
        self._traffic_class, self._class_note = NEW_SOCKET, ""
        if options.promiscuous:
            membership = struct.pack("=iHH8s", device.number, PACKET_MR_PROMISC, 0, b"")
            self._transmitter.setsockopt(SOL_PACKET, PACKET_ADD_MEMBERSHIP, membership)
        if self._is_up:
            self._listen(opening)
        self._link.start()

    def _own(self, device: Device) -> Shared:
        """What the station's interfaces share, with the address of this one: that of its options, or the device's."""
        if self._options.mac:
            return self._shared._replace(mac=mac_address(self._options.mac), is_mac_configured=True)
        if device.mac != NO_MAC:
            return self._shared._replace(mac=device.mac, is_mac_configured=False)
        return self._shared

    def _listen(self, opening: ExitStack) -> None:
        """Open the lanes, on a device that is up: on others kernels before 6.13 refuse it."""
        options, lanes = self._options, self._shared.lanes
        sockets = [opening.enter_context(_socket()) for _ in range(len(lanes) + 1)]
        for one in sockets:
            self._notes = enlarge(one, options.receive_buffer)
            # A socket joins when it is bound, and is in no lane before it has joined: it takes nothing until then.
            keep(one, NONE)
            one.bind((options.device, ETHERTYPE))
        fan_out(sockets, in_packet(lanes))
        urgent: Intake | None = None
        for one in sockets:
            keep(one, ALL if options.promiscuous else NOT_FOR_OTHERS)
            intake = Intake(self._host, one, self._link.receive, self._broken, urgent)
            opening.callback(intake.close)
            urgent = urgent or intake
        self._sockets = sockets

    def _transmit(self, octets: bytes, traffic_class: int) -> Sent:
        if traffic_class != self._traffic_class:
            self._prioritize(traffic_class)
        try:
            self._transmitter.send(octets)
        except OSError as error:
            return self._not_sent(error, len(octets))
        return NOW

    def _beacon(self, octets: bytes) -> Sent | None:
        return self._transmit(octets, BEACON) if self._is_up else None

    def _prioritize(self, traffic_class: int) -> None:
        self._traffic_class = traffic_class
        note = prioritize_frames(self._transmitter, traffic_class)
        if note and not self._class_note:
            self._class_note = note
            self._tell()

    def _not_sent(self, error: OSError, octets: int) -> Sent:
        if error.errno == errno.EMSGSIZE:
            raise RequestError(f"a frame of {octets} octets is too long for {self._options.device}") from error
        if error.errno in NO_ROOM:
            if self._room_timer is None:
                self._room_timer = self._host.loop.after(NO_ROOM_S, self._has_room)
        else:
            self._broken(error)
        return BUSY

    def _has_room(self) -> None:
        self._room_timer = None
        self._host.writable()

    def _broken(self, error: OSError) -> None:
        """A socket's error: of a device that is down or gone the watch tells more."""
        self._watch.look()
        if self._is_up:
            self._host.fail(refused(self._options.device, error))

    def _changed(self, device: Device | None) -> None:
        if device is None:
            self._is_up = False
            self._host.fail(InterfaceError(f"network device {self._options.device} is gone"))
            return
        self._is_up = device.is_usable
        if self._is_up and not self._sockets:
            try:
                self._listen(self._opened)
            except OSError as error:
                self._host.fail(refused(self._options.device, error))
                return
        self._tell()

    def _tell(self) -> None:
        name = self._options.device
        if self._is_up:
            parts = (f"EtherType 0x8947 on {name}", self._notes, self._class_note)
            self._host.link(True, "; ".join(filter(None, parts)))
        else:
            self._host.link(False, f"{name} is down or has no carrier: ip link set {name} up")
