"""What a UDP datagram holds: a bare PDU, a BTP packet, or an Ethernet frame with GeoNetworking."""

from collections.abc import Callable
from operator import attrgetter
from typing import Protocol

from drivers.contract import Host, Shared
from drivers.intake import Deliver
from drivers.lanes import Lanes, Program, in_btp, in_frame, in_pdu
from drivers.message import Request, RxInfo
from drivers.reason import Reason
from drivers.wire import btp


class Framing(Protocol):
    """Datagrams to indications, requests to datagrams; start() and stop() are for what has timers."""

    @property
    def receive(self) -> Deliver: ...
    @property
    def encode(self) -> Callable[[Request], bytes]: ...
    def start(self) -> None: ...
    def stop(self) -> None: ...


class PduFraming:
    """The PDU and nothing else: what arrives goes to the host without a step in between."""

    def __init__(self, host: Host) -> None:
        self.receive: Deliver = host.indicate
        self.encode: Callable[[Request], bytes] = attrgetter("pdu")

    def start(self) -> None: ...
    def stop(self) -> None: ...


class BtpFraming:
    """A BTP-B header and the PDU."""

    def __init__(self, host: Host, shared: Shared) -> None:
        self._host = host
        self._rx_by_port = {port: RxInfo(btp_port=port) for port in shared.btp_ports}

    def receive(self, octets: bytes, received_ns: int) -> None:
        if len(octets) < btp.SIZE:
            self._host.drop(Reason.TRUNCATED, octets)
            return
        port = int.from_bytes(octets[:2])
        # Only ports that are known are kept: a peer may send any of 65,536.
        rx = self._rx_by_port.get(port) or RxInfo(btp_port=port)
        self._host.indicate(octets[btp.SIZE :], received_ns, rx)

    def encode(self, request: Request) -> bytes:
        return btp.encode(btp.BtpB(request.btp_port), request.pdu)

    def start(self) -> None: ...
    def stop(self) -> None: ...


LANE_PROGRAMS: dict[str, Callable[[Lanes], Program]] = {"pdu": in_pdu, "btp": in_btp, "ethernet": in_frame}
