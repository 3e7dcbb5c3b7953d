"""Contract between the station (host) and an interface (driver)."""

from collections.abc import Callable, Mapping
from enum import Enum, Flag, auto
from typing import Any, Final, NamedTuple, Protocol, runtime_checkable

from board.machine import REAL, Machine
from board.runtime.errors import StationError
from board.runtime.loop import Loop
from board.time.scales import Fix, TimeMark
from drivers.message import NO_RX_INFO, Ego, Request, RxInfo
from drivers.reason import Reason
from drivers.wire.geonet.own import OwnPackets


class Can(Flag):
    """Abilities of an interface: a set of flags in its Capabilities.

    RECEIVE       receives PDUs.
    TRANSMIT      sends PDUs.
    POSITION      reports position solutions by host.fix().
    TIMEMARK      reports the time of 1PPS pulses by host.time_mark().
    BEARER        gives other interfaces a network, as a modem does.
    GEOBROADCAST  carries the destination area of a request to the receivers.
    ANYWHERE      reaches receivers at any place, so a request is sent without its destination area.
    """

    RECEIVE = auto()
    TRANSMIT = auto()
    POSITION = auto()
    TIMEMARK = auto()
    BEARER = auto()
    GEOBROADCAST = auto()
    ANYWHERE = auto()  # leaving out the area loses nothing: the PDU contains it as well


class Capabilities(NamedTuple):
    """Properties that a driver declares: abilities, medium, longest PDU and metadata.

    can          abilities of the interface.
    technology   usual name of the medium: its-g5, 5g, udp, ethernet, uart, ...
    max_payload  length of the longest PDU that the interface carries, in octets.
    metadata     names of the RxInfo fields that the driver fills.
    broker       host and port of the broker that the interface uses; equal for all its addresses on this machine. Empty
                 without a broker.
    """

    can: Can
    technology: str
    max_payload: int = 1500
    metadata: frozenset[str] = frozenset()
    broker: str = ""


class Sent(Enum):
    """Result of Driver.send()."""

    NOW = auto()  # the request has left
    LATER = auto()  # the driver keeps the request and calls host.confirm() afterwards, never from inside send()
    BUSY = auto()  # the driver did not take the request; the host keeps it until the driver calls host.writable()


# Drivers import these names because the attribute look-up Sent.NOW costs 0.15 us per message.
NOW: Final = Sent.NOW
LATER: Final = Sent.LATER
BUSY: Final = Sent.BUSY


class Host(Protocol):
    """The station as a driver sees it: one host per interface.

    name  name of the interface in captain.toml.
    slot  name of the board's slot that powers the module; empty if the station cannot switch the module's power.
    loop  event loop of the station: the driver adds its descriptors and timers to it.
    """

    name: str
    slot: str
    loop: Loop

    def indicate(self, pdu: bytes, received_ns: int, rx: RxInfo = NO_RX_INFO) -> None:
        """Pass a received facilities PDU to the station.

        received_ns  time of reception: Unix time in nanoseconds.
        rx           metadata of the reception.
        """

    def request(self, pdu: bytes, btp_port: int | None = None) -> None:
        """Send a PDU of an application behind this interface, as if a user sent it.

        Interfaces at the same broker, this one included, do not send it.

        pdu       facilities PDU of ITS_HEADER to MAX_PDU octets; its messageID decides the type.
        btp_port  destination port that replaces the one of the type.
        """

    def heard(self, mac: bytes, rssi_dbm: int | None) -> None:
        """Report a neighbour that was received without a PDU, for example by its beacon.

        mac       MAC address of the neighbour: 6 octets.
        rssi_dbm  received signal strength; None if the interface does not measure it.
        """

    def drop(self, reason: Reason, sample: bytes = b"", count: int = 1, detail: str = "") -> None:
        """Report received messages that the driver discarded.

        reason  drop reason.
        sample  octets of one discarded message.
        count   number of discarded messages.
        detail  explanation that the reason does not contain.
        """

    def confirm(self, request: Request, reason: Reason | None = None, detail: str = "") -> None:
        """Report the end of a request for which send() returned LATER.

        reason  None if the request has left; otherwise the reason why the driver dropped it.
        detail  explanation that the reason does not contain.
        """

    def writable(self) -> None:
        """Report that the driver can take requests again, after send() returned BUSY."""

    def link(self, is_up: bool, why: str) -> None:
        """Report that the link came up or went down; the driver keeps running.

        why  reason in words, shown in status.
        """

    def starting(self, why: str) -> None:
        """Report a step of the bring-up: the link is not up yet, which is not a fault.

        why  the step in words, shown in status.
        """

    def fail(self, error: StationError) -> None:
        """Report a fault after which the driver cannot continue.

        Before it returns, the host calls stop(). It calls start() again later. The driver may call it at any
        place, also inside send(), which then returns BUSY.
        """

    def ego(self) -> Ego:
        """Return the station's current time, position and speed."""

    def its_ms(self) -> int:
        """Return the station's current ITS time in milliseconds; 0 if it is unknown.

        It is called for each received packet, because it costs less than ego().
        """

    def fix(self, fix: Fix) -> None:
        """Report the position solution of a GNSS receiver for one epoch; for drivers with Can.POSITION."""

    def time_mark(self, mark: TimeMark) -> None:
        """Report the time mark of a GNSS receiver: the time of its next 1PPS pulse; for drivers with Can.TIMEMARK."""

    def report_details(self, details: Mapping[str, object]) -> None:
        """Set the details that status shows beside the link: JSON values by name; they replace earlier details."""


class FrameWatch(Protocol):
    """Observer of the complete frames that interfaces receive and send, for example a recorder.

    A call must return at once: interfaces do not wait for an observer.
    """

    def came(self, interface: str, frame: bytes, received_ns: int, pdu: bytes) -> None:
        """Observe a received frame, before its PDU is indicated.

        pdu  the same object that the interface then passes to indicate(); empty if the frame has none.
        """

    def made(self, interface: str, frame: bytes, request: Request | None) -> None:
        """Observe a frame that is sent.

        request  request of the frame, which has not left yet: its confirm follows. None for a beacon or an answer to
                 a location request, which has left.
        """


class Witness:
    """Holder of the current FrameWatch, shared by all interfaces; most of the time None."""

    watch: FrameWatch | None = None


class Shared(NamedTuple):
    """Settings and objects that all interfaces of one station share; a driver's constructor gets them with its options.

    mac                 MAC address of the station, 6 octets: the last part of its GeoNetworking address.
    gn_versions         accepted GeoNetworking protocol versions.
    deliver_unverified  True: the PDU of a signed packet is delivered, although its signature is not verified.
    btp_ports           BTP ports of the profile in use.
    lanes               messageIDs of each lane. A lane is a receive queue of its own, if the driver can provide one.
                        The first lane is urgent and read before the others. One more lane takes all other messages.
    station_type        station type in the GeoNetworking address: StationType of TS 102 894-2, 0..31; 0 is unknown,
                        15 a roadside unit.
    is_mobile           itsGnIsMobile of EN 302 636-4-1.
    is_mac_configured   True if the user configured mac: the M bit of the GeoNetworking address (clause 6.3).
    machine             location of the kernel's files: the driver of a USB module finds its ports there.
    types               names of the message types by their row (MessageType.row); empty for a type without a name.
    is_clock_set        function that returns True if this machine's clock was set since boot. Without an RTC the clock
                        starts at an arbitrary date.
    witness             holder of the observer of frames, for interfaces that handle complete frames.
    own                 packets sent by all interfaces of the station. None: each interface remembers its own.
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
    """One interface. The constructor stores its options and opens nothing."""

    @property
    def capabilities(self) -> Capabilities:
        """Capabilities of this interface; fixed after construction, and options may have reduced them."""

    def start(self, host: Host) -> None:
        """Open the device and return without waiting.

        Raises InterfaceError if something cannot be opened; everything opened so far is then closed again.
        """

    def send(self, request: Request) -> Sent:
        """Send a request; called only after start().

        Raises RequestError if the interface can never send this request. An interface without Can.TRANSMIT raises it
        for every request.
        """

    def refresh(self) -> None:
        """Report to the host the events that the kernel or the device has counted since the last call."""

    def stop(self) -> None:
        """Report the last counts as refresh() does, then close everything; idempotent."""


Answer = Callable[[Mapping[str, object] | StationError], None]


@runtime_checkable
class Operated(Protocol):
    """A driver that executes commands of an operator, as of `captain modem` and `captain gnss`."""

    def operate(self, do: str, arguments: Mapping[str, object], answer: Answer) -> None:
        """Execute a command and call answer() once, immediately or later, but not after stop().

        do         name of the command.
        arguments  arguments of the command by name.
        answer     gets the result, or a StationError if the command cannot be executed.
        """


@runtime_checkable
class Borne(Protocol):
    """A driver that uses the network of another interface, its bearer; the station reports the bearer's state to it."""

    @property
    def bearer(self) -> str:
        """Name of the interface with Can.BEARER; empty if this driver depends on none."""

    def bearer_changed(self, state: str, device: str, why: str) -> None:
        """Take note that the bearer changed its state, network device or address.

        The station calls it only between start() and stop().

        state   `up`, `starting` or `down`.
        device  name of the bearer's network device, such as wwan0; empty if unknown.
        why     text of the bearer's own link() report.
        """


@runtime_checkable
class Parting(Protocol):
    """A driver that sends its peers a last message in stop(). An ending station waits for that message."""

    def part(self) -> None:
        """Wait until the last message is sent, at most some tenths of a second; called after stop()."""


class DriverClass(Protocol):
    """A driver's class, as DRIVERS contains it. Its Options is the frozen dataclass of its keys in captain.toml."""

    @property
    def Options(self) -> type[Any]: ...  # noqa: N802 it names a class

    def __call__(self, options: Any, shared: Shared) -> Driver: ...
