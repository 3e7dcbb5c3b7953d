"""Contract of benches: an interface under test and its other end."""

from abc import ABC, abstractmethod
from typing import ClassVar, Protocol

from drivers.contract import Can, Driver
from drivers.message import Ego, Position
from drivers.wire import frame
from drivers.wire.geonet.protocol import GeoNetworking, Mib, Received
from tests.drivers.host import Host, request

WITH_AREAS = Can.RECEIVE | Can.TRANSMIT | Can.GEOBROADCAST
NOWHERE = Ego(722_130_000_000, Position(), is_known=False)


class OtherStation:
    """GeoNetworking station that builds and parses frames."""

    def __init__(self) -> None:
        self._mac = bytes.fromhex("020000000077")
        self._core = GeoNetworking(self._mac, Mib(beacon_s=0.0))

    def encode(self, pdu: bytes) -> bytes:
        return frame.wrap(self._mac, self._core.encode(request(pdu), 0.0, NOWHERE))

    def decode(self, octets: bytes) -> bytes:
        ethernet = frame.unwrap(octets)
        assert isinstance(ethernet, frame.Ethernet)
        event = self._core.receive(ethernet.packet, ethernet.source, 0.0, NOWHERE.its_ms, lambda: NOWHERE)
        assert isinstance(event, Received)
        return event.pdu


class Bench(Protocol):
    """Interface and its other end, on a loop and with a folder of its own.

    driver         interface under test.
    patience_s     real seconds to wait for events from the kernel.
    can            capabilities that the driver declares.
    has_process    True if the link comes up when a process of the driver reports it.
    is_brought_up  True if the driver reports steps of the bring-up before its link is up.
    """

    driver: Driver
    patience_s: float
    can: ClassVar[Can] = Can.RECEIVE | Can.TRANSMIT
    has_process: ClassVar[bool] = False
    is_brought_up: ClassVar[bool] = False

    def plug(self) -> None:
        """Create the devices or files that the interface needs, and open the other end."""

    def unplug(self) -> None:
        """Remove these devices or files while the interface uses them; plug() may follow."""

    def close(self) -> None:
        """Close the other end."""

    def say(self, pdu: bytes) -> None:
        """Send a PDU to the interface."""

    def heard(self) -> list[bytes]:
        """Return the PDUs that came from the interface since the last call."""


class ModuleBench(ABC):
    """Interface without messages, and the module at its other end.

    can  capabilities of the driver, such as position or bearer.
    """

    driver: Driver
    patience_s = 0.02
    can: ClassVar[Can]
    has_process = False
    is_brought_up = True

    @abstractmethod
    def plug(self) -> None:
        """Plug the module in, and wait until it has booted."""

    @abstractmethod
    def unplug(self) -> None:
        """Unplug the module while the interface uses it; plug() may follow."""

    @abstractmethod
    def has_served(self, host: Host) -> bool:
        """Return True if the driver has provided the module's service to the host, such as a fix."""

    def close(self) -> None:
        """Remove the module."""
        self.unplug()
