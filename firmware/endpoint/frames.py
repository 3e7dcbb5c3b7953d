"""Frame reports for recorders: topic `frame.<interface>.` of the report port.

Each frame is queued at once; its report is built later, a few at a time, so that messages do not wait for it. An
interface with whole frames passes them on (drivers.contract.FrameWatch). For the other interfaces, a frame is
constructed from the message and its metadata. If a frame is dropped in the same turn of the loop, its report says so.
"""

import time
from collections import Counter
from collections.abc import Callable, Mapping
from typing import Protocol

from board.runtime.loop import Loop
from board.time.scales import TimeQuality
from drivers.message import Confirm, Ego, Indication, Outcome, Request
from drivers.reason import Reason
from firmware.endpoint.frame_report import FrameReport, Noted
from firmware.routing.drops import Drops

# Seconds. Frames are reported together after this delay, so that routing code stays in the processor's caches. It is
# longer than a turn of the loop, so the drop of a frame is known when the frame is reported.
LATER_S = 0.05
# Number of frames that may wait for their report. With LATER_S this is 4,000 per second, two full channels. In a flood,
# further frames are only counted, because routing has priority.
MOST = 200
# At ten times as many frames, no recording can be complete: only OF_FLOOD frames are queued, which leaves more time for
# routing.
FLOOD, OF_FLOOD = 10 * MOST, MOST // 4
SLICE = 16  # number of reports per turn of the loop: a message that arrives meanwhile waits 0.2 ms
MADE = 4096  # limit of frames that wait for the confirm of their request: the queues of several interfaces hold as many

_NOTHING = "", 0
_RECEIVED = frozenset({Reason.DUPLICATE, Reason.IMPLAUSIBLE})  # reasons of routing stages: the frame counts as received
USERS = "users"  # name in place of the interface in the report of a request that reached no interface
ETHERTYPE = b"\x89\x47"

Publish = Callable[[bytes, bytes, bytes], None]  # topic, JSON, octets


class Counted(Protocol):
    """Counters of an interface: received and sent messages by type."""

    received: list[int]
    sent_count: list[int]


class Surroundings(Protocol):
    """Part of the router that frame reports need (firmware.routing.router.Router)."""

    requests: int
    accepted: int

    @property
    def interfaces(self) -> Mapping[str, Counted]: ...
    def ego(self) -> Ego: ...
    def quality_now(self) -> TimeQuality: ...
    def flush(self) -> None: ...


class Frames:
    """Queues and reports frames while a recorder is subscribed.

    publish      sends topic, JSON object and octets of a report.
    mac          MAC address of the station; source address of constructed frames that leave.
    drops        counters of dropped messages.
    attend       called with False to stop the calls about messages and whole frames, and with True to resume them. In a
                 flood they are stopped for part of the time. The frames of that time are counted from the station's
                 counters. Calls about drops never stop.
    is_counting  True counts frames without a subscriber as missed: the only subscriber is the station's recorder, which
                 may be killed and restarted.
    """

    def __init__(
        self,
        loop: Loop,
        publish: Publish,
        station: Surroundings,
        mac: bytes,
        drops: Drops,
        attend: Callable[[bool], None] = lambda is_wanted: None,
        is_counting: bool = False,
    ) -> None:
        self._loop = loop
        self._publish = publish
        self._station = station
        self._drops = drops
        self._attend = attend
        self._noted: list[Noted] = []
        self._telling: list[Noted] = []
        # Keys are the interface and the id() of the octets; each Noted keeps its octets alive, so no id() is reused.
        self._by_octets: dict[tuple[str, int], Noted] = {}
        self._dropped: dict[tuple[str, int], Noted] = {}  # dropped messages without a queued frame, by the same keys
        self._made: dict[tuple[str, int], bytes] = {}  # frames that were sent, by interface and number of the request
        self._has_frames: set[str] = set()
        self._missed: Counter[str] = Counter()
        self._just_missed = _NOTHING  # key of the last drop that was counted as missed; its confirm may follow
        self._counted: dict[str, int] | None = None  # counts by interface when the queue was full; None while it is not
        self._told = FrameReport(mac)
        self._most = MOST
        self._is_scheduled = False
        self._is_counting = is_counting
        self._away: dict[str, int] | None = None  # counts by interface when the last subscriber left

    def forget(self) -> None:
        """Discard all queued frames, because the last subscriber left. If is_counting, count them as missed."""
        missed: Counter[str] = Counter()
        if self._is_counting:
            # The router counts a message before it passes it on. After the flush, each counted one has a queued frame.
            self._station.flush()
            for one in (*self._telling, *self._noted, *self._dropped.values()):
                missed[one.interface] += 1 + one.missed
            missed += self._missed
            self._away = self._counts() if self._counted is None else self._counted
        for kept in (self._noted, self._telling, self._by_octets, self._dropped, self._made):
            kept.clear()
        self._missed = missed
        self._counted = None

    def resume(self) -> None:
        """Count the frames since the last subscriber left as missed, if is_counting: a new subscriber came."""
        before, self._away = self._away, None
        if before is not None:
            self._station.flush()
            self._missed.update(self._since(before))

    def totals(self) -> dict[str, int]:
        """Return the number of reported and missed frames by interface; frames still queued are not counted."""
        totals = Counter(self._told.totals)
        if not (self._noted or self._telling or self._dropped):
            totals.update(self._missed)
        return dict(totals)

    def finish(self) -> None:
        """Report all queued frames, because the station stops."""
        self._take_up()
        while self._telling:
            self._go_on()

    # Called by interfaces with whole frames: drivers.contract.FrameWatch.

    def came(self, interface: str, frame: bytes, received_ns: int, pdu: bytes) -> None:
        self._has_frames.add(interface)
        if (one := self._note(interface, received_ns, frame, pdu)) is not None:
            self._by_octets[interface, id(frame)] = one
            if pdu:
                self._by_octets[interface, id(pdu)] = one

    def made(self, interface: str, frame: bytes, request: Request | None) -> None:
        self._has_frames.add(interface)
        if request is None:
            if (one := self._note(interface, time.time_ns(), frame, b"")) is not None:
                one.is_out = True
        elif len(self._made) < MADE or (interface, request.number) in self._made:
            self._made[interface, request.number] = frame

    # Called by the router: firmware.routing.router.Observer and ConfirmListener, and
    # firmware.routing.drops.DropListener.

    def observe(self, indications: list[Indication]) -> None:
        """Queue a frame for each received message, before any routing stage, or add the message to its frame."""
        for indication in indications:
            interface, pdu = indication.interface, indication.pdu
            if interface in self._has_frames:
                one = self._by_octets.get((interface, id(pdu)))
            elif len(self._noted) >= self._most:  # check of _note(), copied for speed: in a flood most calls end here
                self._missed[interface] += 1
                continue
            else:
                one = self._by_octets[interface, id(pdu)] = self._new(interface, indication.received_ns, b"", pdu)
                self._noted.append(one)
            if one is not None:
                one.indication = indication
                one.quality = indication.quality
        if len(self._noted) >= self._most:
            self._look_away()

    def confirm(self, confirm: Confirm, targets: object = ()) -> None:
        """Queue the frame of a request with its outcome: sent or dropped by an interface, or refused by the router."""
        request, interface = confirm.request, confirm.interface or USERS
        if confirm.outcome is Outcome.ACCEPTED:
            return
        self._take_back(interface, request.pdu)
        frame = self._made.pop((interface, request.number), b"")
        if (one := self._note(interface, time.time_ns(), frame, request.pdu)) is not None:
            one.is_out = True
            one.confirm, one.reason, one.detail = confirm, confirm.reason, confirm.detail
        if len(self._noted) >= self._most:
            self._look_away()

    def drop(self, where: str, reason: Reason, sample: bytes, count: int, detail: str) -> None:
        """Add the reason to the frame of a dropped message, or queue a frame for it.

        A drop without octets counts as missed. A dropped request also has a confirm: see _take_back().
        """
        if where not in self._station.interfaces:
            return
        if (one := self._by_octets.get((where, id(sample)))) is not None:
            one.reason, one.detail = reason, detail
        elif self._counted is not None:
            return  # the queue is full: _look_again() computes the missed frames from the station's counters
        elif sample and len(self._noted) + len(self._dropped) < self._most:
            one = self._new(where, time.time_ns(), self._whole(where, sample), sample)
            one.reason, one.detail = reason, detail
            self._dropped[where, id(sample)] = one
        elif not sample:
            self._missed[where] += count
        elif where not in self._has_frames:  # for an interface with frames, the frame itself was counted as missed
            self._missed[where] += count
            self._just_missed = where, id(sample)

    def _take_back(self, where: str, pdu: bytes) -> None:
        """Remove the queued frame or the count of a dropped request: its confirm, with more fields, replaces it."""
        key = where, id(pdu)
        if (one := self._dropped.pop(key, None)) is not None:
            self._missed[where] += one.missed
        elif key == self._just_missed:
            self._missed[where] -= 1
        self._just_missed = _NOTHING  # forget the id() of the octets, because a later object may have the same one

    def _whole(self, where: str, sample: bytes) -> bytes:
        """Return the dropped octets if they are a whole frame with the EtherType of GeoNetworking; else no octets."""
        return sample if where in self._has_frames and sample[12:14] == ETHERTYPE else b""

    def _note(self, interface: str, when_ns: int, frame: bytes, pdu: bytes) -> Noted | None:
        if len(self._noted) >= self._most:
            self._missed[interface] += 1
            return None
        one = self._new(interface, when_ns, frame, pdu)
        self._noted.append(one)
        return one

    def _new(self, interface: str, when_ns: int, frame: bytes, pdu: bytes) -> Noted:
        self._schedule()
        return Noted(interface, self._missed.pop(interface, 0), when_ns, self._station.quality_now(), frame, pdu)

    def _schedule(self) -> None:
        if not self._is_scheduled:
            self._is_scheduled = True
            self._loop.after(LATER_S, self._begin)

    def _look_away(self) -> None:
        """Stop the calls about messages, because the queue is full. The station's counters count further frames."""
        if self._counted is None:
            self._counted = self._counts()
            self._attend(False)

    def _look_again(self) -> None:
        before, self._counted = self._counted, None
        self._most = MOST
        if before is not None:
            # Messages that the counters include are passed on before the calls resume, so that they are not queued too.
            self._station.flush()
            self._made.clear()  # their confirms may have arrived without a call to this object
            missed = self._since(before)
            self._missed.update(missed)
            if sum(missed.values()) > FLOOD:
                self._most = OF_FLOOD
            self._attend(True)

    def _since(self, before: Mapping[str, int]) -> dict[str, int]:
        """Return the number of messages by interface since an earlier call of _counts(), whose result is `before`."""
        return {name: count - before.get(name, 0) for name, count in self._counts().items()}

    def _counts(self) -> dict[str, int]:
        """Return the number of received, sent and dropped messages by interface, and of refused requests as USERS.

        Drops by a routing stage are left out: those messages are already among the received ones.
        """
        station = self._station
        counts = {
            name: sum(one.received) + sum(one.sent_count) + self._drops.sum(name, without=_RECEIVED)
            for name, one in station.interfaces.items()
        }
        return {**counts, USERS: station.requests - station.accepted}

    def _begin(self) -> None:
        self._is_scheduled = False
        # The router passes on the messages of this turn, so that their frames have an outcome.
        self._station.flush()
        is_telling = bool(self._telling)
        self._take_up()
        if not is_telling:
            self._go_on()
        if len(self._telling) < MOST:
            self._look_again()
        else:
            self._schedule()

    def _take_up(self) -> None:
        self._telling += self._noted
        self._telling += self._dropped.values()
        self._noted = []
        self._by_octets.clear()
        self._dropped.clear()
        self._just_missed = _NOTHING

    def _go_on(self) -> None:
        part, self._telling = self._telling[:SLICE], self._telling[SLICE:]
        if part:
            now_ns, ego = time.time_ns(), self._station.ego()
            for one in part:
                self._publish(*self._told.of(one, now_ns, ego))
        if self._telling:
            self._loop.soon(self._go_on)
