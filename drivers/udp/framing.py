"""Framings of UDP datagrams: bare PDU, BTP packet, or Ethernet frame with GeoNetworking."""

from collections.abc import Callable
from operator import attrgetter
from typing import Protocol

from drivers.contract import Host, Shared
from drivers.message import Request, RxInfo
from drivers.packet.intake import Deliver
from drivers.packet.lanes import Lanes, Program, in_btp, in_frame, in_pdu
from drivers.reason import Reason
from drivers.wire import btp


class Framing(Protocol):
    """Conversion of datagrams to indications and of requests to datagrams.

    receive       handles a received datagram.
    encode        returns the datagram of a request.
    start, stop   start and stop timers, if the framing has any.
    """

    @property
    def receive(self) -> Deliver: ...
    @property
    def encode(self) -> Callable[[Request], bytes]: ...
    def start(self) -> None: ...
    def stop(self) -> None: ...


class PduFraming:
    """Framing `pdu`: a datagram is the PDU alone, so the host's indicate() gets it directly."""

    def __init__(self, host: Host) -> None:
        self.receive: Deliver = host.indicate
        self.encode: Callable[[Request], bytes] = attrgetter("pdu")

    def start(self) -> None: ...
    def stop(self) -> None: ...


class BtpFraming:
    """Framing `btp`: a datagram is a BTP-B header and the PDU."""

    def __init__(self, host: Host, shared: Shared) -> None:
        self._host = host
        self._rx_by_port = {port: RxInfo(btp_port=port) for port in shared.btp_ports}

    def receive(self, octets: bytes, received_ns: int) -> None:
        if len(octets) < btp.SIZE:
            self._host.drop(Reason.TRUNCATED, octets)
            return
        port = int.from_bytes(octets[:2])
        # RxInfo objects are kept for the ports of the profile only: a peer may send any of 65,536 ports.
        rx = self._rx_by_port.get(port) or RxInfo(btp_port=port)
        self._host.indicate(octets[btp.SIZE :], received_ns, rx)

    def encode(self, request: Request) -> bytes:
        return btp.encode(btp.BtpB(request.btp_port), request.pdu)

    def start(self) -> None: ...
    def stop(self) -> None: ...


LANE_PROGRAMS: dict[str, Callable[[Lanes], Program]] = {"pdu": in_pdu, "btp": in_btp, "ethernet": in_frame}
