"""One interface of the station: the host of a driver, its counters, its neighbours and its queue."""

import logging
from collections.abc import Callable, Mapping
from typing import Protocol

from board.errors import RequestError, StationError
from board.journal import Journal
from board.loop import Loop
from board.time import Fix, TimeMark, TimeQuality
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
from firmware.drops import Drops
from firmware.implausible import DENM, ImplausibleCounts, doubted, is_denm_ahead
from firmware.neighbours import Neighbours
from firmware.outlet import Outlet
from firmware.tables import QueueOptions
from firmware.topics import Topics

_new = tuple.__new__

log = logging.getLogger("captain.interface")


class Above(Protocol):
    """What an interface needs of the station."""

    is_confirm_wanted: bool
    quality: TimeQuality
    quality_until: float

    def renewed_quality(self) -> TimeQuality: ...

    def indicate(self, indication: Indication) -> None: ...
    def confirm(self, confirm: Confirm) -> None: ...
    def links_changed(self) -> None: ...
    def ego(self) -> Ego: ...


class Interface:
    """Host of one driver. The supervisor starts and stops it; the router gives it requests."""

    def __init__(
        self,
        name: str,
        driver: Driver,
        options: QueueOptions,
        loop: Loop,
        above: Above,
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
        self.is_up = False
        self.why = "not started"
        self.since = loop.clock()
        self.on_fail: Callable[[StationError], None] = lambda error: None
        self.on_fix: Callable[[Fix], None] = lambda fix: None
        self.on_link: Callable[[bool, str], None] = lambda is_up, why: None
        self.on_time_mark: Callable[[TimeMark], None] = lambda mark: None
        self.on_unverified: Callable[[], None] = lambda: None
        self.details: Mapping[str, object] = {}
        self.can_transmit = Can.TRANSMIT in driver.capabilities.can
        self.neighbours = Neighbours()
        self.implausible = ImplausibleCounts(name)
        self._heard = self.neighbours.heard
        self.received = [0] * len(topics.kinds)
        self.sent_count = [0] * len(topics.kinds)
        self.received_octets = 0
        self.sent_octets = 0
        gap_s = 1.0 / options.rate_per_s if options.rate_per_s else 0.0
        self.outlet = Outlet(loop, self, options.queue, gap_s)
        self._above = above
        self._indicate = above.indicate
        self._clock = loop.clock
        self._topics = topics
        self._by_number = topics.by_number
        self._journal = Journal(log, name, loop.clock)
        self._any_port = False
        self._drops = drops

    def accept_any_port(self) -> None:
        """Pass on PDUs of BTP ports that no table knows."""
        self._any_port = True

    # What the driver calls: drivers.contract.Host.

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
                self.on_unverified()
            latitude, longitude = rx.position  # as is_outside(), without a call for each message
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
        self._heard(who, now, rssi_dbm)
        above = self._above
        quality = above.quality if now < above.quality_until else above.renewed_quality()
        # tuple.__new__ is what Indication() comes to, at half the price.
        self._indicate(_new(Indication, (kind, pdu, self.name, received_ns, now, rx, quality)))

    def _doubt(self, kind: MessageType, pdu: bytes, rx: RxInfo) -> RxInfo:
        """Look closer at a message, and count it where it is implausible; what is known of it, with the reasons."""
        is_ahead = kind.number == DENM and is_denm_ahead(pdu, self._above.ego().its_ms)
        if rx is NO_RX_INFO and not is_ahead:
            return rx
        rx = doubted(rx, is_ahead)
        if rx.implausible:
            self.implausible.count(rx, pdu)
        return rx

    def _size_reason(self, size: int, btp_port: int | None) -> Reason | None:
        """Why a PDU of an impossible size is dropped; None for a short one of an unknown port that is wanted.

        What such a port carries need not begin with an ITS PDU header.
        """
        is_unknown = btp_port is not None and btp_port not in self._topics.ports
        if is_unknown and not self._any_port:
            return Reason.BTP_PORT
        if size == 0:
            return Reason.EMPTY_PDU
        if size > MAX_PDU:
            return Reason.LONG_PDU
        return None if is_unknown else Reason.SHORT_PDU

    def heard(self, mac: bytes, rssi_dbm: int | None) -> None:
        self.neighbours.heard(mac, self.loop.clock(), rssi_dbm)

    def drop(self, reason: Reason, sample: bytes = b"", count: int = 1, detail: str = "") -> None:
        self._drops.count(self.name, reason, sample, count, detail)

    def confirm(self, request: Request, reason: Reason | None = None, detail: str = "") -> None:
        self.outlet.confirm(request, reason, detail)

    def writable(self) -> None:
        self.outlet.writable()

    def link(self, is_up: bool, why: str) -> None:
        if (is_up, why) == (self.is_up, self.why):
            return
        has_changed = is_up is not self.is_up
        self.is_up = is_up
        self.why = why
        self._journal.say(logging.INFO, f"{'up' if is_up else 'down'}: {why}")
        self.on_link(is_up, why)
        if has_changed:
            self.since = self.loop.clock()
            self._above.links_changed()
            if is_up:
                self.outlet.writable()

    def fail(self, error: StationError) -> None:
        self.link(False, error.message)
        self.on_fail(error)

    def ego(self) -> Ego:
        return self._above.ego()

    def fix(self, fix: Fix) -> None:
        self.on_fix(fix)

    def time_mark(self, mark: TimeMark) -> None:
        self.on_time_mark(mark)

    def tell(self, details: Mapping[str, object]) -> None:
        self.details = details

    # What its queue calls: firmware.outlet.Outgoing.

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

    def status(self) -> dict[str, object]:
        """Counters by type, link and queue, as in the status message."""
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
    """Counts by the name in the envelope: two ids may have one name, and some have none."""
    named: dict[str, int] = {}
    for kind, count in zip(topics.kinds, counts, strict=True):
        if count:
            name = kind.name or "unknown"
            named[name] = named.get(name, 0) + count
    return named
