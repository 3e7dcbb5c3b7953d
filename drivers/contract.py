"""The contract between the station and an interface: a driver below, its host above."""

from collections.abc import Callable, Mapping
from enum import Enum, Flag, auto
from typing import Any, Final, NamedTuple, Protocol, runtime_checkable

from board.errors import StationError
from board.loop import Loop
from board.machine import REAL, Machine
from board.time import Fix, TimeMark
from drivers.message import NO_RX_INFO, Ego, Request, RxInfo
from drivers.reason import Reason
from drivers.wire.geonet_own import OwnPackets


class Can(Flag):
    """What an interface is able to do."""

    RECEIVE = auto()
    TRANSMIT = auto()
    POSITION = auto()
    TIMEMARK = auto()
    BEARER = auto()
    GEOBROADCAST = auto()  # a request's area is carried to the receivers
    ANYWHERE = auto()  # receivers are reached wherever they are: a request leaves without its area, which the PDU has


class Capabilities(NamedTuple):
    """What a driver declares about itself.

    technology   the field's name for the medium: its-g5, 5g, udp, ethernet, uart, ...
    max_payload  octets of a PDU that it can carry.
    metadata     names of the RxInfo fields that it fills.
    """

    can: Can
    technology: str
    max_payload: int = 1500
    metadata: frozenset[str] = frozenset()


class Sent(Enum):
    """What send() did with a request."""

    NOW = auto()  # it has left
    LATER = auto()  # the driver keeps it and will call host.confirm(), never from inside send()
    BUSY = auto()  # it could not be taken; the host keeps it until the driver calls host.writable()


# By these names a message costs less: Sent.NOW is a look-up of 0.15 us.
NOW: Final = Sent.NOW
LATER: Final = Sent.LATER
BUSY: Final = Sent.BUSY


class Host(Protocol):
    """What a driver may ask of the station: one host per interface."""

    name: str  # of the interface, as in captain.toml
    slot: str  # that its module sits in and has its power from; empty: nobody can cut it
    loop: Loop

    def indicate(self, pdu: bytes, received_ns: int, rx: RxInfo = NO_RX_INFO) -> None:
        """A facilities PDU was received; received_ns is Unix time in nanoseconds."""

    def heard(self, mac: bytes, rssi_dbm: int | None) -> None:
        """A neighbour showed itself without a PDU: a beacon."""

    def drop(self, reason: Reason, sample: bytes = b"", count: int = 1, detail: str = "") -> None:
        """Something received was not passed on; detail: what the reason leaves out."""

    def confirm(self, request: Request, reason: Reason | None = None, detail: str = "") -> None:
        """A request that send() kept for LATER has left, or was dropped for a reason; detail: what that leaves out."""

    def writable(self) -> None:
        """Requests can be taken again after BUSY."""

    def link(self, is_up: bool, why: str) -> None:
        """The link came up or went down; the driver itself goes on."""

    def fail(self, error: StationError) -> None:
        """The driver cannot go on: the host calls stop() at once and start() again later.

        May be called from anywhere, also from inside send(), which then returns BUSY.
        """

    def ego(self) -> Ego:
        """Own time and position, now."""

    def fix(self, fix: Fix) -> None:
        """A receiver's solution of one epoch, with POSITION."""

    def time_mark(self, mark: TimeMark) -> None:
        """What a receiver says of its next pulse, with TIMEMARK."""

    def tell(self, details: Mapping[str, object]) -> None:
        """What status shows of the module beside its link, as JSON; replaces what was told before."""


class FrameWatch(Protocol):
    """Who looks at whole frames as interfaces have them: a recorder. Nothing of it is waited for."""

    def came(self, interface: str, frame: bytes, received_ns: int, pdu: bytes) -> None:
        """A frame was received; pdu is what of it will be indicated, the very object, or empty."""

    def made(self, interface: str, frame: bytes, request: Request | None) -> None:
        """A request's frame is about to leave, which its confirm tells; without one a beacon or an answer has left."""


class Witness:
    """Where an interface finds who looks: nobody, most of the time."""

    watch: FrameWatch | None = None


class Shared(NamedTuple):
    """What all interfaces of one station have in common; given to a driver's constructor beside its options.

    mac                 the station's own address: 6 octets, the end of its GeoNetworking address.
    gn_versions         GeoNetworking protocol versions that are accepted.
    deliver_unverified  pass a signed packet's PDU on, although its signature is not verified.
    btp_ports           BTP ports of the profile in use.
    lanes               messageIDs of each lane: what has a queue of its own at reception, where the driver can give
                        it one. The first is urgent and read before the others; what is in none is in one more.
    station_type        of the GeoNetworking address: StationType of TS 102 894-2, 0..31; 0 is unknown, 15 a roadside
                        unit.
    is_mobile           itsGnIsMobile of EN 302 636-4-1.
    is_mac_configured   whether mac was given by the user: the M bit of the GeoNetworking address (clause 6.3).
    machine             where the kernel's files are: a driver of a USB module finds its ports there.
    types               names of the message types by their row (MessageType.row); empty where one has none.
    is_clock_set        whether the clock of this machine was ever set: without a battery it begins at any date.
    witness             where those interfaces that have whole frames find who looks at them.
    own                 packets that the station has sent, of all its interfaces; None: each keeps its own.
    """

    mac: bytes
    gn_versions: frozenset[int] = frozenset({1})
    deliver_unverified: bool = True
    btp_ports: frozenset[int] = frozenset()
    lanes: tuple[frozenset[int], ...] = (frozenset({1}),)
    station_type: int = 0
    is_mobile: bool = True
    is_mac_configured: bool = False
    machine: Machine = REAL
    types: tuple[str, ...] = ()
    is_clock_set: Callable[[], bool] = lambda: True
    witness: Witness = Witness()
    own: OwnPackets | None = None


class Driver(Protocol):
    """One interface. The constructor takes its options and touches nothing."""

    @property
    def capabilities(self) -> Capabilities:
        """Known once it is constructed: options may take some away."""

    def start(self, host: Host) -> None:
        """Open what it needs and return at once. Raises InterfaceError, having closed what it had opened."""

    def send(self, request: Request) -> Sent:
        """Send a request; after start(). Raises RequestError for one it can never send: without TRANSMIT, for each."""

    def refresh(self) -> None:
        """Report to the host what the kernel or the device has counted since the last time."""

    def stop(self) -> None:
        """Close everything, having reported a last time as refresh() does; idempotent."""


Answer = Callable[[Mapping[str, object] | StationError], None]


@runtime_checkable
class Operated(Protocol):
    """A driver that an operator may ask more of: `captain modem`, `captain gnss`."""

    def operate(self, do: str, arguments: Mapping[str, object], answer: Answer) -> None:
        """Do what is asked and answer once, at once or later; after stop() no more.

        What cannot be done is answered with a StationError.
        """


@runtime_checkable
class Borne(Protocol):
    """A driver whose peers are reached by a mobile network: told how the interface is that its option names."""

    @property
    def bearer(self) -> str:
        """Name of an interface with BEARER; empty: none is followed."""

    def bearer_changed(self, is_up: bool, device: str, why: str) -> None:
        """The bearer came up or went down, or has another network device or address now; between start() and stop().

        device  of the network, as in wwan0; empty where it is not known.
        why     in words, as its own link has it.
        """


@runtime_checkable
class Parting(Protocol):
    """A driver with a last word to its peers: said by stop(), and waited for where the loop turns no more."""

    def part(self) -> None:
        """Wait until it is said, some tenths of a second at most; after stop()."""


class DriverClass(Protocol):
    """A driver's class as DRIVERS holds it; Options is the frozen dataclass of its keys in captain.toml."""

    @property
    def Options(self) -> type[Any]: ...  # noqa: N802 it names a class

    def __call__(self, options: Any, shared: Shared) -> Driver: ...
