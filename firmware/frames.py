"""Frames as they came and left, for a recorder: topic `frame.<interface>.` of the report port.

In the way of a message one is only noted, and what it says is made later, a few at a time. An interface that has whole
frames shows them (drivers.contract.FrameWatch); of others one is made up of message and metadata. What is dropped in
the same moment is told with its frame.
"""

import time
from collections import Counter
from collections.abc import Callable, Mapping
from typing import Protocol

from board.loop import Loop
from board.time import TimeQuality
from drivers.message import Confirm, Ego, Indication, Outcome, Request
from drivers.reason import Reason
from firmware.drops import Drops
from firmware.frame_told import Noted, Told

# They are told so much later, together: what routes stays in the processor's caches. A drop that belongs to a frame
# follows it in the same turn of the loop.
LATER_S = 0.05
# What is noted until it is told: 4,000 frames a second, two channels at their ceiling. Of a flood the rest is
# counted, and not even looked at: routing goes first.
MOST = 200
# Ten times as many are no recording of a channel any more, whatever is told of them: still less of it is.
FLOOD, OF_FLOOD = 10 * MOST, MOST // 4
SLICE = 16  # told in one turn: a message that comes meanwhile waits for 0.2 ms
MADE = 4096  # requests whose frames wait for their confirm: as many as the queues of some interfaces hold

_NOTHING = "", 0
_RECEIVED = frozenset({Reason.DUPLICATE, Reason.IMPLAUSIBLE})  # dropped by a stage
USERS = "users"  # stands for the interface of what got to none
ETHERTYPE = b"\x89\x47"

Publish = Callable[[bytes, bytes, bytes], None]  # topic, JSON, octets


class Counted(Protocol):
    """Of an interface: what it has received and sent, by type."""

    received: list[int]
    sent_count: list[int]


class Surroundings(Protocol):
    """What frames ask of the station: firmware.router.Router."""

    requests: int
    accepted: int

    @property
    def interfaces(self) -> Mapping[str, Counted]: ...
    def ego(self) -> Ego: ...
    def quality_now(self) -> TimeQuality: ...
    def flush(self) -> None: ...


class Frames:
    """Notes and tells them. Only while somebody listens is anything here called.

    mac       the station's own, of what is made up to go out.
    drops     what was dropped so far.
    attend    is told whether messages and whole frames are to be shown: in a flood for a part of the time, and what
              comes in the rest is known from the station's counters. Drops are always shown.
    clock_ns  Unix time.
    is_counting  what comes while nobody listens is missed by who listens next: a recorder that was killed.
    """

    def __init__(
        self,
        loop: Loop,
        publish: Publish,
        station: Surroundings,
        mac: bytes,
        drops: Drops,
        attend: Callable[[bool], None] = lambda is_wanted: None,
        clock_ns: Callable[[], int] = time.time_ns,
        is_counting: bool = False,
    ) -> None:
        self._loop = loop
        self._publish = publish
        self._station = station
        self._drops = drops
        self._attend = attend
        self._clock_ns = clock_ns
        self._noted: list[Noted] = []
        self._telling: list[Noted] = []
        self._by_octets: dict[tuple[str, int], Noted] = {}  # by interface and id() of what is kept in them
        self._dropped: dict[tuple[str, int], Noted] = {}  # what no frame of this moment explains
        self._made: dict[tuple[str, int], bytes] = {}  # by interface and number of the request
        self._has_frames: set[str] = set()
        self._missed: Counter[str] = Counter()
        self._just_missed = _NOTHING  # a drop of this very moment, whose confirm comes next
        self._counted: dict[str, int] | None = None  # by interface, when enough had come
        self._told = Told(mac)
        self._most = MOST
        self._is_scheduled = False
        self._is_counting = is_counting
        self._away: dict[str, int] | None = None  # counts of when the last one left

    def forget(self) -> None:
        """Nobody listens any more."""
        missed: Counter[str] = Counter()
        if self._is_counting:
            self._station.flush()  # what is counted already has its frame noted
            for one in (*self._telling, *self._noted, *self._dropped.values()):
                missed[one.interface] += 1 + one.missed
            missed += self._missed
            self._away = self._counts() if self._counted is None else self._counted
        for kept in (self._noted, self._telling, self._by_octets, self._dropped, self._made):
            kept.clear()
        self._missed = missed
        self._counted = None

    def resume(self) -> None:
        """Somebody listens, perhaps again."""
        before, self._away = self._away, None
        if before is not None:
            self._station.flush()
            self._missed.update(self._since(before))

    def totals(self) -> dict[str, int]:
        """Return the number of frames, reported or missed, by interface; without those that still wait."""
        totals = Counter(self._told.totals)
        if not (self._noted or self._telling or self._dropped):
            totals.update(self._missed)
        return dict(totals)

    def finish(self) -> None:
        """Tell what still waits: the station ends."""
        self._take_up()
        while self._telling:
            self._go_on()

    # Of an interface that has frames: drivers.contract.FrameWatch.

    def came(self, interface: str, frame: bytes, received_ns: int, pdu: bytes) -> None:
        self._has_frames.add(interface)
        if (one := self._note(interface, received_ns, frame, pdu)) is not None:
            self._by_octets[interface, id(frame)] = one
            if pdu:
                self._by_octets[interface, id(pdu)] = one

    def made(self, interface: str, frame: bytes, request: Request | None) -> None:
        self._has_frames.add(interface)
        if request is None:
            if (one := self._note(interface, self._clock_ns(), frame, b"")) is not None:
                one.is_out = True
        elif len(self._made) < MADE or (interface, request.number) in self._made:
            self._made[interface, request.number] = frame

    # Of the station: firmware.router.Router.observe, its report, and firmware.drops.Drops.watch.

    def observe(self, indications: list[Indication]) -> None:
        """What interfaces have brought, before any stage."""
        for indication in indications:
            interface, pdu = indication.interface, indication.pdu
            if interface in self._has_frames:
                one = self._by_octets.get((interface, id(pdu)))
            elif len(self._noted) >= self._most:  # as _note() has it; of a flood this is what most comes to
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
        """What became of a request at one interface, or that it got to none."""
        request, interface = confirm.request, confirm.interface or USERS
        if confirm.outcome is Outcome.ACCEPTED:
            return
        self._take_back(interface, request.pdu)
        frame = self._made.pop((interface, request.number), b"")
        if (one := self._note(interface, self._clock_ns(), frame, request.pdu)) is not None:
            one.is_out = True
            one.confirm, one.reason, one.detail = confirm, confirm.reason, confirm.detail
        if len(self._noted) >= self._most:
            self._look_away()

    def drop(self, where: str, reason: Reason, sample: bytes, count: int, detail: str) -> None:
        """A discard, as it is counted. Of users' own there is a confirm; what nobody has seen is missed."""
        if where not in self._station.interfaces:
            return
        if (one := self._by_octets.get((where, id(sample)))) is not None:
            one.reason, one.detail = reason, detail
        elif self._counted is not None:
            return  # it is in the counters
        elif sample and len(self._noted) + len(self._dropped) < self._most:
            one = self._new(where, self._clock_ns(), self._whole(where, sample), sample)
            one.reason, one.detail = reason, detail
            self._dropped[where, id(sample)] = one
        elif not sample:
            self._missed[where] += count
        elif where not in self._has_frames:  # else its frame was missed already
            self._missed[where] += count
            self._just_missed = where, id(sample)

    def _take_back(self, where: str, pdu: bytes) -> None:
        """What was noted or counted of a drop a moment ago: its confirm says more."""
        key = where, id(pdu)
        if (one := self._dropped.pop(key, None)) is not None:
            self._missed[where] += one.missed
        elif key == self._just_missed:
            self._missed[where] -= 1
        self._just_missed = _NOTHING  # what comes later may have its place in memory

    def _whole(self, where: str, sample: bytes) -> bytes:
        """What was dropped, where it is a frame: an interface that has them looks at the EtherType first."""
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
        """Enough for now; the station's counters say how much else comes."""
        if self._counted is None:
            self._counted = self._counts()
            self._attend(False)

    def _look_again(self) -> None:
        before, self._counted = self._counted, None
        self._most = MOST
        if before is not None:
            self._station.flush()  # what is counted already is not to be noted as well
            self._made.clear()  # their confirms may have come meanwhile
            missed = self._since(before)
            self._missed.update(missed)
            if sum(missed.values()) > FLOOD:
                self._most = OF_FLOOD
            self._attend(True)

    def _since(self, before: Mapping[str, int]) -> dict[str, int]:
        """Messages that came or left since these counts."""
        return {name: count - before.get(name, 0) for name, count in self._counts().items()}

    def _counts(self) -> dict[str, int]:
        """Messages by interface: what a stage has dropped was received as well, whatever else was dropped was not."""
        station = self._station
        counts = {
            name: sum(one.received) + sum(one.sent_count) + self._drops.sum(name, without=_RECEIVED)
            for name, one in station.interfaces.items()
        }
        return {**counts, USERS: station.requests - station.accepted}

    def _begin(self) -> None:
        self._is_scheduled = False
        self._station.flush()  # what came in this very turn has its frame noted, and not yet what became of it
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
            now_ns, ego = self._clock_ns(), self._station.ego()
            for one in part:
                self._publish(*self._told.of(one, now_ns, ego))
        if self._telling:
            self._loop.soon(self._go_on)
