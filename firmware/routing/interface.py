"""Interface: host of one driver, with counters, neighbours and a queue."""

import logging
from collections.abc import Mapping
from typing import Protocol

from board.runtime.errors import RequestError, StationError
from board.runtime.journal import Journal
from board.runtime.loop import Loop
from board.time.scales import Fix, TimeMark, TimeQuality
from drivers.contract import Can, Driver, Sent
from drivers.implausible import MOST_LATITUDE, MOST_LONGITUDE
from drivers.message import (
    ITS_HEADER,
    MAX_PDU,
    NO_MAC,
    NO_RX_INFO,
    NOT_SECURED,
    Confirm,
    Ego,
    Indication,
    MessageType,
    Outcome,
    Request,
    RxInfo,
    SecurityStatus,
)
from drivers.reason import Reason
from firmware.config.tables import QueueOptions
from firmware.routing.drops import Drops
from firmware.routing.implausible import DENM, ImplausibleCounts, doubted, is_denm_ahead
from firmware.routing.neighbours import Neighbours
from firmware.routing.options import NOTHING_ASKED, Parsed, RequestOptions
from firmware.routing.outlet import Outlet
from firmware.topics import Topics

FROM_BROKERS = "from_brokers"  # place of the drop counters for refused requests of applications at brokers
_new = tuple.__new__

log = logging.getLogger("captain.interface")


class UpperLayer(Protocol):
    """Part of the router that an interface calls (firmware.routing.router.Router)."""

    is_confirm_wanted: bool
    quality: TimeQuality
    quality_until: float

    def renewed_quality(self) -> TimeQuality: ...

    def indicate(self, indication: Indication) -> None: ...
    def request(self, kind: MessageType, pdu: bytes, where: str, asked: Parsed, origin: "Interface") -> None: ...
    def confirm(self, confirm: Confirm) -> None: ...
    def links_changed(self) -> None: ...
    def ego(self) -> Ego: ...
    def its_ms(self) -> int: ...


class InterfaceListener:
    """Receiver of an interface's reports other than messages. This base class ignores them."""

    def link_changed(self, state: str, why: str) -> None:
        """Take a change of the link's state or of its reason.

        state  `up`, `down` or `starting`: see Interface.link_state.
        why    reason of the state, in words.
        """

    def fix(self, fix: Fix) -> None:
        """Take a position from the interface's GNSS receiver."""

    def time_mark(self, mark: TimeMark) -> None:
        """Take a time mark from the interface's GNSS receiver."""

    def delivered_unverified(self) -> None:
        """Take note that a signed message is delivered although its signature is not verified."""


class DriverSupervisor(Protocol):
    """Supervisor that starts and stops the driver (firmware.station.interface_supervisor)."""

    def driver_failed(self, error: StationError) -> None: ...


class BearerFollower(Protocol):
    """Driver that reaches its network through this interface, its bearer."""

    def bearer_link_changed(self) -> None: ...


class Interface:
    """Host of one driver, between driver and router. The supervisor starts and stops it."""

    def __init__(
        self,
        name: str,
        driver: Driver,
        options: QueueOptions,
        loop: Loop,
        above: UpperLayer,
        topics: Topics,
        drops: Drops,
    ) -> None:
        self.name = name
        self.loop = loop
        self.driver = driver
        self.driver_name = options.driver
        self.slot = options.slot
        self._technology = options.technology or driver.capabilities.technology
        self._max_payload = driver.capabilities.max_payload
        self._carries_areas = bool(driver.capabilities.can & (Can.GEOBROADCAST | Can.ANYWHERE))
        self.is_up = self.is_starting = False
        self.why = "not started"
        self._reported = False, False, self.why
        self.since = loop.clock()
        self.listener = InterfaceListener()
        self.supervisor: DriverSupervisor | None = None
        self.followers: list[BearerFollower] = []
        self.details: Mapping[str, object] = {}
        self.can_transmit = Can.TRANSMIT in driver.capabilities.can
        self.neighbours = Neighbours()
        self.implausible = ImplausibleCounts(name)
        self.received = [0] * len(topics.kinds)
        self.sent_count = [0] * len(topics.kinds)
        self.received_octets = 0
        self.sent_octets = 0
        gap_s = 1.0 / options.rate_per_s if options.rate_per_s else 0.0
        self.outlet = Outlet(loop, self, options.queue, gap_s)
        self._above = above
        self._clock = loop.clock
        self._topics = topics
        self._by_number = topics.by_number
        self._journal = Journal(log, name, loop.clock)
        self._any_port = False
        self._drops = drops

    def accept_any_port(self) -> None:
        """Pass on received PDUs of BTP ports that are not in the table of types; otherwise they are dropped."""
        self._any_port = True

    def add_kind(self) -> None:
        """Count another type, which was added to the table of types."""
        self.received.append(0)
        self.sent_count.append(0)

    # Called by the driver: drivers.contract.Host.

    def indicate(self, pdu: bytes, received_ns: int, rx: RxInfo = NO_RX_INFO) -> None:
        size = len(pdu)
        if not ITS_HEADER <= size <= MAX_PDU and (reason := self._size_reason(size, rx.btp_port)) is not None:
            self.drop(reason, pdu)
            return
        who, rssi_dbm, is_doubted = pdu[2:6], None, False
        if rx is not NO_RX_INFO:
            if rx.btp_port is not None and rx.btp_port not in self._topics.ports and not self._any_port:
                self.drop(Reason.BTP_PORT, pdu)
                return
            rssi_dbm = rx.rssi_dbm
            if rx.source_mac != NO_MAC:
                who = rx.source_mac
            elif rx.source:
                who = rx.source.encode()
            if rx.security is not NOT_SECURED and rx.security.status is SecurityStatus.UNVERIFIABLE_PKT:
                self.listener.delivered_unverified()
            latitude, longitude = rx.position  # same test as is_outside(), without the cost of a call per message
            is_doubted = (
                rx.implausible != ()
                or not -MOST_LATITUDE < latitude <= MOST_LATITUDE
                or not -MOST_LONGITUDE < longitude <= MOST_LONGITUDE
            )
        kind = self._by_number[pdu[1]] if size >= ITS_HEADER else self._topics.unknown
        if is_doubted or kind.number == DENM:
            rx = self._doubt(kind, pdu, rx)
        self.received[kind.row] += 1
        self.received_octets += size
        now = self._clock()
        self.neighbours.heard(who, now, rssi_dbm)
        above = self._above
        quality = above.quality if now < above.quality_until else above.renewed_quality()
        # tuple.__new__ has the same result as Indication() and takes half the time.
        above.indicate(_new(Indication, (kind, pdu, self.name, received_ns, now, rx, quality)))

    def _doubt(self, kind: MessageType, pdu: bytes, rx: RxInfo) -> RxInfo:
        """Check the plausibility of a message and count it if it is implausible. Return rx with the reasons."""
        is_ahead = kind.number == DENM and is_denm_ahead(pdu, self._above.its_ms())
        if rx is NO_RX_INFO and not is_ahead:
            return rx
        rx = doubted(rx, is_ahead)
        if rx.implausible:
            self.implausible.count(rx, pdu)
        return rx

    def _size_reason(self, size: int, btp_port: int | None) -> Reason | None:
        """Return the drop reason for an invalid size; None if the size is valid.

        A PDU of a BTP port outside the table of types need not begin with an ITS PDU header. If such ports are
        accepted, a PDU shorter than the header is valid.
        """
        is_unknown = btp_port is not None and btp_port not in self._topics.ports
        if is_unknown and not self._any_port:
            return Reason.BTP_PORT
        if size == 0:
            return Reason.EMPTY_PDU
        if size > MAX_PDU:
            return Reason.LONG_PDU
        return None if is_unknown else Reason.SHORT_PDU

    def request(self, pdu: bytes, btp_port: int | None = None) -> None:
        asked = NOTHING_ASKED if btp_port is None else Parsed(RequestOptions(btp_port=btp_port), None)
        self._above.request(self._by_number[pdu[1]], pdu, FROM_BROKERS, asked, self)

    def heard(self, mac: bytes, rssi_dbm: int | None) -> None:
        self.neighbours.heard(mac, self.loop.clock(), rssi_dbm)

    def drop(self, reason: Reason, sample: bytes = b"", count: int = 1, detail: str = "") -> None:
        self._drops.count(self.name, reason, sample, count, detail)

    def confirm(self, request: Request, reason: Reason | None = None, detail: str = "") -> None:
        self.outlet.confirm(request, reason, detail)

    def writable(self) -> None:
        self.outlet.writable()

    @property
    def link_state(self) -> str:
        """State of the link: `up`, `down`, or `starting` from the start of the driver until it reports one of these."""
        return "up" if self.is_up else "starting" if self.is_starting else "down"

    def begin(self) -> None:
        """Note the start of the driver. It is not reported, since a retry often fails with the same reason."""
        self.is_starting = True
        self.why = "waiting for its link"

    def link(self, is_up: bool, why: str) -> None:
        self._report_link(is_up, False, why)

    def starting(self, why: str) -> None:
        self._report_link(False, True, why)

    def _report_link(self, is_up: bool, is_starting: bool, why: str) -> None:
        state = is_up, is_starting, why
        if state == (self.is_up, self.is_starting, self.why):
            return
        has_changed = is_up is not self.is_up
        self.is_up, self.is_starting, self.why = state
        if state != self._reported:
            self._reported = state
            self._journal.say(logging.INFO, f"{self.link_state}: {why}")
            self.listener.link_changed(self.link_state, why)
        for follower in self.followers:
            follower.bearer_link_changed()
        if has_changed:
            self.since = self.loop.clock()
            self._above.links_changed()
            if is_up:
                self.outlet.writable()

    def fail(self, error: StationError) -> None:
        self.link(False, error.message)
        if self.supervisor is not None:
            self.supervisor.driver_failed(error)

    def ego(self) -> Ego:
        return self._above.ego()

    def its_ms(self) -> int:
        return self._above.its_ms()

    def fix(self, fix: Fix) -> None:
        self.listener.fix(fix)

    def time_mark(self, mark: TimeMark) -> None:
        self.listener.time_mark(mark)

    def report_details(self, details: Mapping[str, object]) -> None:
        self.details = details

    # Called by its queue: firmware.routing.outlet.Outgoing.

    def transmit(self, request: Request) -> Sent | None:
        if len(request.pdu) > self._max_payload:
            self.dropped(request, Reason.LONG_PDU, detail=f"{self.name} carries {self._max_payload} octets")
            return None
        if request.area is not None and not self._carries_areas:
            self.dropped(request, Reason.NO_AREA)
            return None
        try:
            return self.driver.send(request)
        except RequestError as error:
            self.dropped(request, Reason.SEND_FAILED, detail=str(error))
            return None

    def sent(self, request: Request, handed_over: float) -> None:
        self.sent_count[request.kind.row] += 1
        self.sent_octets += len(request.pdu)
        if self._above.is_confirm_wanted:
            queue_s, send_s = handed_over - request.accepted, self.loop.clock() - handed_over
            self._above.confirm(Confirm(request, Outcome.SENT, self.name, None, queue_s, send_s))

    def dropped(self, request: Request, reason: Reason, handed_over: float | None = None, detail: str = "") -> None:
        self._drops.count(self.name, reason, request.pdu, detail=detail)
        if self._above.is_confirm_wanted:
            now = self.loop.clock()
            left = now if handed_over is None else handed_over
            queue_s, send_s = left - request.accepted, now - left
            self._above.confirm(Confirm(request, Outcome.DROPPED, self.name, reason, queue_s, send_s, detail))

    def is_at_broker_of(self, other: "Interface") -> bool:
        """Return True if both interfaces are the same one, or use the same broker."""
        broker = self.driver.capabilities.broker
        return self is other or (broker != "" and broker == other.driver.capabilities.broker)

    def status(self) -> dict[str, object]:
        """Return counters by type, link and queue.

        driver           kind of interface.
        technology       medium, such as `its-g5`.
        slot             slot of the module; absent if the interface has none.
        why              reason of the link's state, in words.
        since_s          seconds since the link went up or down.
        neighbours       number of stations heard in the last 5 s.
        implausible      implausible messages: a row for each reason; absent without such messages.
        received         number of received messages, by type.
        sent             number of sent messages, by type.
        received_octets  sum of the lengths of received PDUs.
        sent_octets      sum of the lengths of sent PDUs.
        queue.length     number of requests that wait.
        queue.capacity   number of requests that may wait.
        queue.longest    largest number of requests that have waited since the start.
        details          further values that the driver reports about its module; absent if it reports none.
        """
        now = self.loop.clock()
        outlet = self.outlet
        return {
            "driver": self.driver_name,
            "technology": self._technology,
            **({"slot": self.slot} if self.slot else {}),
            "why": self.why,
            "since_s": round(now - self.since, 3),
            "neighbours": self.neighbours.count(now),
            **({"implausible": found} if (found := self.implausible.status()) else {}),
            "received": _by_name(self._topics, self.received),
            "sent": _by_name(self._topics, self.sent_count),
            "received_octets": self.received_octets,
            "sent_octets": self.sent_octets,
            "queue": {"length": outlet.length, "capacity": outlet.capacity, "longest": outlet.longest},
            **({"details": self.details} if self.details else {}),
        }


def _by_name(topics: Topics, counts: list[int]) -> dict[str, int]:
    """Return the counts by the name in the envelope, without zeros.

    Two messageIDs may share a name: their counts are added. A messageID without a name counts as `unknown`.
    """
    named: dict[str, int] = {}
    for kind, count in zip(topics.kinds, counts, strict=True):
        if count:
            name = kind.name or "unknown"
            named[name] = named.get(name, 0) + count
    return named
