"""One station that is metered: its reports and what its users get, over the network, into the meter."""

import math
import os
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple

import zmq

from board.errors import StationError
from firmware.meter import told
from firmware.meter.meter import Meter
from firmware.meter.place import place_of
from firmware.meter.tap import GLANCE, Tap
from firmware.report import boot_id, digest_of
from firmware.user import client
from firmware.user.received import Message
from firmware.user.table import times
from firmware.user.untrusted import number, text, texts, within

REPORTS = ("confirm.", "indication.", "status.")
# A status comes once a second. Nothing is judged while one is late; when three have not come, nobody is heard.
BEAT_S = 1.2
SILENT_S = 3.5
JOIN_MS = 50
# Of the confirms of this meter's own messages; each adds its number.
LABEL = f"captain-meter-{os.getpid()}-{time.time_ns():x}"
PLAIN = 20  # messages after which it is plain that two sockets are not of one station
MOST_SECONDS = 7200  # of a clock's quality


class Second(NamedTuple):
    """What a station said of its clock in one second; None where it did not know."""

    at_s: float
    state: str
    offset_ns: int | None
    uncertainty_ns: int | None


class Watch:
    """Takes what comes from one station.

    line       the meter's time line: Unix time that never steps.
    is_whole   every message that its users get is looked at, and not the first of each second.
    delivered  is called with each message that the station has given to its users, and when it was here (monotonic ns).
    missed_indications, missed_confirms  reports that this meter did not hear.
    """

    def __init__(
        self,
        name: str,
        place: client.Address,
        context: client.Context,
        meter: Meter,
        line: Callable[[], float],
        delivered: Callable[[str, str, int], None],
        is_whole: bool = False,
    ) -> None:
        self.name = name
        self.place = place
        self.status: Mapping[str, object] = {}
        self.seconds: deque[Second] = deque(maxlen=MOST_SECONDS)
        self.missed_indications = self.missed_confirms = self.restarts = 0
        self.silent_s = 0.0
        self.heard_s = line()
        self.own = Own()
        self.reports = client.subscribe(context, place, place.report, *REPORTS)
        self.users = Tap(context, place, is_whole)
        self._meter = meter
        self._line = line
        self._delivered = delivered
        self._sequences: dict[str, int] = {}
        self._is_measuring = False
        self._given = self._got = 0  # messages to users until it began, and of them those that came here
        self._own_boot = boot_id()

    @property
    def boot(self) -> str:
        return text(self.status, "boot")

    def join(self) -> None:
        """Wait until both sockets have shown that nothing is missed from now on. Raises StationError.

        What is received counts from then on: what was sent is measured after begin(), when all stations have joined.
        """
        end_s = self._line() + client.ANSWER_S
        while not (self.status and self.users.has_beat) and self._line() < end_s:
            for socket in (self.reports, self.users.socket):
                socket.poll(JOIN_MS)
            self.take()
        if not self.status:
            raise StationError(
                f"what listens at {self.place.host}:{self.place.report} sent no status within {client.ANSWER_S:g} s",
                f"is that the report port of station {self.name}? its ports are HOST:PORT and the three after it",
            )
        if "boot" not in self.status:
            raise StationError(
                f"station {self.name} is of version {text(self.status, 'version')}: it does not say what a meter needs",
                "update it: `captain update`",
            )
        if not self.users.has_beat:
            raise StationError(
                f"what listens at {self.place.host}:{self.place.to_users} sent no heartbeat",
                f"is that where users of station {self.name} subscribe?",
            )
        self.heard_s = self._line()

    def begin(self, is_first: bool = False) -> None:
        """What leaves from now on is measured: whoever receives it is heard. is_first: nothing has left before."""
        self._is_measuring = True
        self._given, self._got = self._published(), self.users.count
        if not is_first:
            self._meter.hears(self.name, self._line())

    def take(self) -> None:
        """What has come by both."""
        for message, now_ns in self.users.take(self._line()):
            self._to_user(message, now_ns)
        for frames in client.waiting(self.reports):
            report = client.parse_report(frames)
            if report is not None:
                self._report(*report)

    def end(self) -> None:
        """What leaves from now on is not measured: nobody would wait for its arrival."""
        self._is_measuring = False
        self._meter.silent(self.name, self._line())

    def told(self) -> dict[str, object]:
        """What a report has to say of this station."""
        clock = within(self.status, "clock")
        uncertainty_ns = clock.get("uncertainty_ns")
        return {
            "where": f"{self.place.host}:{self.place.from_users}",
            "station": text(self.status, "station"),
            "version": text(self.status, "version"),
            "configuration": text(self.status, "configuration"),
            "boot": self.boot,
            "time": text(clock, "state"),
            "uncertainty_us": uncertainty_ns / 1000 if isinstance(uncertainty_ns, int) else None,
            "clock": [second._asdict() for second in self.seconds],
            "interfaces": told.interfaces(self.status),
            "missed_indications": self.missed_indications,
            "missed_confirms": self.missed_confirms,
            "notes": list(self._notes()),
        }

    def _notes(self) -> Iterator[str]:
        if self.missed_indications or self.missed_confirms:
            yield (
                f"{self.missed_indications} indications and {self.missed_confirms} confirms were not heard: "
                "the report port or this meter did not keep up; nothing of that is counted as lost"
            )
        given, got = self._published() - self._given, self.users.count - self._got
        if max(given, got) >= PLAIN and min(given, got) == 0:
            yield (
                f"its users were given {given} messages, and {got} came here by "
                f"{self.place.host}:{self.place.to_users}: its ports are not all of one station"
            )
        elif self.users.is_part:
            yield (
                f"of {given} messages to its users {got} were looked at, the first {GLANCE} of each second, "
                "for places on the map and the way up to users: all of them would burden it"
            )
        if (silent_s := self._line() - self.heard_s) > SILENT_S:
            yield f"it has not been heard for {silent_s:.1f} s, at the end: what was sent meanwhile is unseen"
        if self.silent_s:
            yield f"it was silent for {self.silent_s:.1f} s: what was sent meanwhile is unseen"
        if self.restarts:
            yield f"it was started anew {times(self.restarts)}"

    def _published(self) -> int:
        """Messages that the station has given to its users, as it says."""
        return round(number(within(self.status, "endpoint"), "published"))

    def look(self, now_s: float) -> None:
        """Called now and then: whether the station is still heard."""
        if now_s - self.heard_s > SILENT_S:
            self._meter.unheard(self.name, math.inf, self.heard_s, now_s)

    def judged_until(self, now_s: float) -> float:
        """Up to when what this station says is known, as far as one can tell."""
        silent_s = now_s - self.heard_s
        return now_s if silent_s <= BEAT_S or silent_s > SILENT_S else self.heard_s

    def _report(self, topic: str, said: Mapping[str, object]) -> None:
        now_s = self._line()
        if now_s - self.heard_s > SILENT_S:
            self.silent_s += now_s - self.heard_s
            self._meter.unheard(self.name, math.inf, self.heard_s, now_s)
        if topic == "status.":
            self._note_status(said)
        elif topic.startswith("indication."):
            self.missed_indications += self._missed("indication", said, now_s)
            self._meter.received(told.received(self.name, said, self.boot, now_s))
        elif topic.startswith("confirm."):
            self.missed_confirms += self._missed("confirm", said, now_s)
            self._confirm(said, now_s)
        self.heard_s = now_s

    def _confirm(self, said: Mapping[str, object], now_s: float) -> None:
        self.own.add(said)
        if not self._is_measuring:
            return
        event = told.sent(self.name, said, self.boot, now_s)
        if event is not None:
            self._meter.sent(event._replace(is_probe=text(said, "label").startswith(LABEL)))
        elif text(said, "outcome") in ("dropped", "refused"):
            self._meter.inside.not_sent(self.name, text(said, "interface"), text(said, "reason"))

    def _missed(self, kind: str, said: Mapping[str, object], now_s: float) -> int:
        """How many reports of a kind were not heard before this one."""
        sequence = round(number(said, "sequence"))
        missed = self._gap(kind, sequence - 1, now_s)
        self._sequences[kind] = sequence
        return missed

    def _gap(self, kind: str, last: int, now_s: float) -> int:
        """How many were not heard, if the last one was this; a lower number is that of a station started anew."""
        missed = max(0, last - self._sequences.get(kind, last))
        if missed:
            self._sequences[kind] = last
            if kind == "indication":
                self._meter.unheard(self.name, missed, self.heard_s, now_s)
            else:
                self._meter.silent(self.name, self.heard_s, now_s)
        return missed

    def _note_status(self, status: Mapping[str, object]) -> None:
        now_s = self._line()
        if self.status and _is_another(self.status, status):
            self.restarts += 1
            self._given -= self._published()  # it counts from 0 on
            self._sequences.clear()
            self._meter.unheard(self.name, math.inf, self.heard_s, now_s)
        self.status = status
        report = within(status, "report")
        self.missed_indications += self._gap("indication", round(number(report, "indications")), now_s)
        self.missed_confirms += self._gap("confirm", round(number(report, "confirms")), now_s)
        for kind in ("indication", "confirm"):
            self._sequences.setdefault(kind, round(number(report, f"{kind}s")))
        self._meter.station(self.name, told.interfaces(status))
        if (place := told.place_of(status)) is not None:
            self._meter.spots.station(self.name, now_s, place)
        clock = within(status, "clock")
        quality = told.clock_of(clock, "")
        self.seconds.append(Second(now_s, text(clock, "state"), quality.offset_ns, quality.uncertainty_ns))

    def _to_user(self, message: Message, now_ns: int) -> None:
        digest = digest_of(message.pdu)
        self._delivered(self.name, digest, now_ns)
        raw = message.raw
        is_one_clock = bool(self._own_boot) and self.boot == self._own_boot
        here_ns = time.time_ns() - (time.monotonic_ns() - now_ns) if is_one_clock else None
        self._meter.inside.to_user(self.name, message.type, None if raw is None else raw.received_ns, here_ns)
        place = place_of(message.pdu) if raw is None else place_of(message.pdu, raw.rx.position)
        if place is not None:
            self._meter.spots.place(digest, place)


class Own:
    """Confirms of the meter's own messages: of how many it is known by which interfaces they are to leave, and did."""

    def __init__(self) -> None:
        self._known = self._expected = self._over = 0

    def add(self, confirm: Mapping[str, object]) -> None:
        if not text(confirm, "label").startswith(LABEL):
            return
        outcome = text(confirm, "outcome")
        self._known += outcome in ("accepted", "refused")
        self._over += outcome in ("sent", "dropped")
        if outcome == "accepted":
            self._expected += len(texts(confirm, "interfaces"))

    def is_over(self, count: int) -> bool:
        """Whether everything is known of so many."""
        return self._known >= count and self._over >= self._expected


def _is_another(before: Mapping[str, object], status: Mapping[str, object]) -> bool:
    """Whether a station was started anew: in a container its process has one number for ever."""
    is_same = all(before.get(key) == status.get(key) for key in ("boot", "pid"))
    return not is_same or number(status, "uptime_s") < number(before, "uptime_s")


def registered(watches: list[Watch]) -> zmq.Poller:
    """What wakes when any of them has something."""
    poller = zmq.Poller()
    for watch in watches:
        poller.register(watch.reports, zmq.POLLIN)
        poller.register(watch.users.socket, zmq.POLLIN)
    return poller
