"""GeoNetworking on a network device, EtherType 0x8947: 802.11p in OCB mode, or any wire."""

import errno
import socket
import struct
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from typing import Annotated, ClassVar

from board.netlink import DeviceWatch, NetworkDevice
from board.runtime.address import check_device_name, mac_address
from board.runtime.describe import Range, all_of, at_key
from board.runtime.errors import InterfaceError, RequestError
from board.runtime.loop import Timer
from drivers.contract import BUSY, NOW, Can, Capabilities, Host, Sent, Shared
from drivers.message import NO_MAC, Request
from drivers.packet.access_category import BEACON, NEW_SOCKET, prioritize_frames
from drivers.packet.geolink import GEONETWORKING_METADATA, MAX_PAYLOAD, GeoLink
from drivers.packet.intake import Intake, enlarge, not_permitted, refused
from drivers.packet.lanes import ALL, NONE, NOT_FOR_OTHERS, SOL_PACKET, fan_out, in_packet, keep
from drivers.reason import Reason

ETHERTYPE = 0x8947
# Numbers of linux/if_packet.h that the socket module does not name.
PACKET_ADD_MEMBERSHIP = 1
PACKET_STATISTICS = 6
PACKET_MR_PROMISC = 1

# Errors of a full device queue. The kernel reports no event when the queue has room again, so the driver tries again
# after NO_ROOM_S.
NO_ROOM = frozenset({errno.ENOBUFS, errno.EAGAIN, errno.ENOMEM})
NO_ROOM_S = 0.005


@dataclass(frozen=True)
class EthernetOptions:
    """GeoNetworking in Ethernet frames (EtherType 0x8947): 802.11p in OCB mode, or a wire.

    device          name of the network device.
    mac             own address, such as "02:00:00:00:00:0b". Empty: that of the device.
    promiscuous     also take frames for other stations' addresses.
    receive_buffer  receive queue in the kernel for each message type; all types together may take 20 times as much.
    beacon_s        a beacon is sent after this time without another packet. 0: no beacons.
    gn_version      GeoNetworking protocol version of sent packets; this interface also accepts it.
    """

    device: str
    mac: str = ""
    promiscuous: bool = False
    receive_buffer: Annotated[int, Range(2048, 268_435_456)] = 4_194_304
    beacon_s: Annotated[float, Range(0.0, 3600.0)] = 3.0
    gn_version: Annotated[int, Range(0, 1)] = 1

    def __post_init__(self) -> None:
        """Check the options. Raises ConfigurationError with a line for each mistake."""
        checks = [partial(at_key, "device", check_device_name, self.device)]
        if self.mac:
            checks.append(partial(at_key, "mac", mac_address, self.mac))
        all_of(checks)


def _socket() -> socket.socket:
    # With protocol 0 the socket receives nothing until it is bound to another protocol. A socket bound to one protocol
    # gets no copies of frames that leave by the device, so own frames are not received.
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
        self._device: _Device | None = None

    def start(self, host: Host) -> None:
        """Open the device. Raises InterfaceError if it is absent or cannot be opened."""
        try:
            self._device = _Device(self._options, self._shared, host)
        except PermissionError as error:
            raise not_permitted(self._options.device) from error
        except OSError as error:
            raise refused(self._options.device, error) from error
        self._device.tell()

    def send(self, request: Request) -> Sent:
        device = self._device
        if device is None:
            return BUSY
        return device.transmit(device.link.encode(request), request.traffic_class)

    def refresh(self) -> None:
        if self._device is not None:
            self._device.count_drops()

    def stop(self) -> None:
        if self._device is not None:
            self._device.close()
            self._device = None


class _Device:
    """An open network device: device watch, receive sockets (lanes) and send socket.

    Raises InterfaceError if the device does not exist, OSError if it cannot be opened.
    """

    def __init__(self, options: EthernetOptions, shared: Shared, host: Host) -> None:
        self._options = options
        self._shared = shared
        self._host = host
        self._sockets: list[socket.socket] = []
        self._room_timer: Timer | None = None
        self._notes = self._class_note = ""
        self._traffic_class = NEW_SOCKET
        with ExitStack() as opening:
            self._watch = DeviceWatch(host.loop, options.device, self._changed)
            opening.callback(self._watch.close)
            device = self._watch.state
            if device is None:
                raise InterfaceError(f"{options.device}: no such network device", "`ip link` lists them")
            self._is_up = device.is_usable
            own = self._own(device)
            self.link = GeoLink(host, own, own.mac, options.beacon_s, self._beacon, options.gn_version)
            opening.callback(self.link.stop)
            self._transmitter = opening.enter_context(_socket())
            self._transmitter.bind((options.device, 0))
            if options.promiscuous:
                membership = struct.pack("=iHH8s", device.number, PACKET_MR_PROMISC, 0, b"")
                self._transmitter.setsockopt(SOL_PACKET, PACKET_ADD_MEMBERSHIP, membership)
            if self._is_up:
                self._listen(opening)
            self.link.start()
            self._opened = opening.pop_all()

    def count_drops(self) -> None:
        for one in self._sockets:
            # struct tpacket_stats: packets, drops. Reading resets both to 0. Neither includes frames that a filter
            # rejects.
            statistics = one.getsockopt(SOL_PACKET, PACKET_STATISTICS, 8)
            drops = struct.unpack("=II", statistics)[1]
            if drops:
                self._host.drop(Reason.KERNEL_QUEUE, count=drops)

    def close(self) -> None:
        self.count_drops()
        self._sockets = []
        self._is_up = False
        self._opened.close()
        if self._room_timer is not None:
            self._room_timer.cancel()
            self._room_timer = None

    def _own(self, device: NetworkDevice) -> Shared:
        """Return the shared settings with the MAC address of this interface: from its options, else the device's."""
        if self._options.mac:
            return self._shared._replace(mac=mac_address(self._options.mac), is_mac_configured=True)
        if device.mac != NO_MAC:
            return self._shared._replace(mac=device.mac, is_mac_configured=False)
        return self._shared

    def _listen(self, opening: ExitStack) -> None:
        """Open the lanes. The device must be up: Linux before 6.13 refuses it on a device that is down."""
        options, lanes = self._options, self._shared.lanes
        sockets = [opening.enter_context(_socket()) for _ in range(len(lanes) + 1)]
        for one in sockets:
            self._notes = enlarge(one, options.receive_buffer)
            # A bound socket would receive the frames of all lanes until fan_out() makes it one lane, so a filter
            # rejects everything until then.
            keep(one, NONE)
            one.bind((options.device, ETHERTYPE))
        fan_out(sockets, in_packet(lanes))
        urgent: Intake | None = None
        for one in sockets:
            keep(one, ALL if options.promiscuous else NOT_FOR_OTHERS)
            intake = Intake(self._host, one, self.link.receive, self._broken, urgent)
            opening.callback(intake.close)
            urgent = urgent or intake
        self._sockets = sockets

    def transmit(self, octets: bytes, traffic_class: int) -> Sent:
        if traffic_class != self._traffic_class:
            self._prioritize(traffic_class)
        try:
            self._transmitter.send(octets)
        except OSError as error:
            return self._not_sent(error, len(octets))
        return NOW

    def _beacon(self, octets: bytes) -> Sent | None:
        return self.transmit(octets, BEACON) if self._is_up else None

    def _prioritize(self, traffic_class: int) -> None:
        self._traffic_class = traffic_class
        note = prioritize_frames(self._transmitter, traffic_class)
        if note and not self._class_note:
            self._class_note = note
            self.tell()

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
        """Report the error of a socket, unless the device watch finds that the device is down or gone."""
        self._watch.look()
        if self._is_up:
            self._host.fail(refused(self._options.device, error))

    def _changed(self, device: NetworkDevice | None) -> None:
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
        self.tell()

    def tell(self) -> None:
        name = self._options.device
        if self._is_up:
            parts = (f"EtherType 0x8947 on {name}", self._notes, self._class_note)
            self._host.link(True, "; ".join(filter(None, parts)))
        else:
            self._host.link(False, f"{name} is down or has no carrier: ip link set {name} up")
