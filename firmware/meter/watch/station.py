"""Watch of one station: passes its reports and messages to the meter."""

import math
import os
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple

import zmq

from board.runtime.errors import StationError
from firmware.client import client
from firmware.client.received import Message
from firmware.client.show.table import times
from firmware.endpoint.report import boot_id, digest_of
from firmware.meter.meter import Meter
from firmware.meter.sender_position import position_of
from firmware.meter.watch import status_fields
from firmware.meter.watch.tap import GLANCE, Tap
from firmware.untrusted import number, text, texts, within

REPORTS = ("confirm.", "indication.", "status.")
# A status comes once a second. No message is settled while one is late; after SILENT_S the station counts as silent.
BEAT_S = 1.2
SILENT_S = 3.5
JOIN_MS = 50
# Prefix of the labels of this meter's own messages; each message adds its number.
LABEL = f"captain-meter-{os.getpid()}-{time.time_ns():x}"
PLAIN = 20  # number of messages after which two sockets evidently belong to different stations
MOST_SECONDS = 7200  # seconds kept of a clock's quality


class Second(NamedTuple):
    """Report of a station on its clock in one second; None: unknown."""

    at_s: float
    state: str
    offset_ns: int | None
    uncertainty_ns: int | None


class Watch:
    """Receiver of one station's reports and messages.

    line       meter's time line: Unix time that never steps.
    is_whole   read all messages to its users, not only the first of each second.
    delivered  called with station, digest and monotonic time in ns for each message that the station delivered to its
               users.
    missed_indications, missed_confirms  reports that the meter missed.
    restarts   restarts of the station.
    silent_s   seconds in which the station was silent.
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
        # Number of messages to users before the measurement: as the station reports, and as received here.
        self._given = self._got = 0
        self._own_boot = boot_id()

    @property
    def boot(self) -> str:
        return text(self.status, "boot")

    def join(self) -> None:
        """Wait until both sockets are connected: from then on no report is missed.

        Receptions count from now on; sent messages count from begin(), when all stations have joined. Raises
        StationError if status or heartbeat do not come, or the station is too old for a meter.
        """
        end_s = self._line() + client.ANSWER_S
        while not (self.status and self.users.has_beat) and self._line() < end_s:
            for socket in (self.reports, self.users.socket):
                socket.poll(JOIN_MS)
            self.take()
        if not self.status:
            raise StationError(
                f"{self.name}: {self.place.host}:{self.place.report}: no status within {client.ANSWER_S:g} s",
                "name the station's first port; reports come from the third after it",
            )
        if "boot" not in self.status:
            raise StationError(
                f"{self.name}: version {text(self.status, 'version')} lacks reports that a meter needs",
                "update it: `captain update`",
            )
        if not self.users.has_beat:
            raise StationError(
                f"{self.name}: {self.place.host}:{self.place.to_users}: no heartbeat",
                "name the port where the station's users subscribe",
            )
        self.heard_s = self._line()

    def begin(self, is_first: bool = False) -> None:
        """Begin to measure the messages that the station sends; is_first: it has sent none before."""
        self._is_measuring = True
        self._given, self._got = self._published(), self.users.count
        if not is_first:
            self._meter.hears(self.name, self._line())

    def take(self) -> None:
        """Process what has arrived on both sockets."""
        for message, now_ns in self.users.take(self._line()):
            self._to_user(message, now_ns)
        for frames in client.waiting(self.reports):
            report = client.parse_report(frames)
            if report is not None:
                self._report(*report)

    def end(self) -> None:
        """Stop measuring the messages that the station sends."""
        self._is_measuring = False
        self._meter.silent(self.name, self._line())

    def told(self) -> dict[str, object]:
        """Return the description of this station for a report."""
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
            "interfaces": status_fields.interfaces(self.status),
            "missed_indications": self.missed_indications,
            "missed_confirms": self.missed_confirms,
            "notes": list(self._notes()),
        }

    def _notes(self) -> Iterator[str]:
        if self.missed_indications or self.missed_confirms:
            yield (
                f"{self.missed_indications} indications and {self.missed_confirms} confirms were missed: "
                "the report port or this meter was too slow; they do not count as lost"
            )
        given, got = self._published() - self._given, self.users.count - self._got
        if max(given, got) >= PLAIN and min(given, got) == 0:
            yield (
                f"{given} messages went to its users, {got} came from {self.place.host}:{self.place.to_users}; "
                "the ports belong to different stations"
            )
        elif self.users.is_part:
            yield (
                f"{got} of {given} messages to its users were read, the first {GLANCE} of each second. "
                "Places on the map and delays up to users are from these"
            )
        if (silent_s := self._line() - self.heard_s) > SILENT_S:
            yield f"silent for the last {silent_s:.1f} s: messages sent meanwhile are unseen"
        if self.silent_s:
            yield f"silent for {self.silent_s:.1f} s: messages sent meanwhile are unseen"
        if self.restarts:
            yield f"restarted {times(self.restarts)}"

    def _published(self) -> int:
        """Return the number of messages that the station has delivered to its users, as it reports."""
        return round(number(within(self.status, "endpoint"), "published"))

    def look(self, now_s: float) -> None:
        """Check that the station is still heard; the caller calls it every LOOK_S."""
        if now_s - self.heard_s > SILENT_S:
            self._meter.unheard(self.name, math.inf, self.heard_s, now_s)

    def judged_until(self, now_s: float) -> float:
        """Return the time up to which messages can be judged as arrived or lost.

        It is now; but while a report of the station is late, it is the time of the last report.
        """
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
            self._meter.received(status_fields.received(self.name, said, self.boot, now_s))
        elif topic.startswith("confirm."):
            self.missed_confirms += self._missed("confirm", said, now_s)
            self._confirm(said, now_s)
        self.heard_s = now_s

    def _confirm(self, said: Mapping[str, object], now_s: float) -> None:
        self.own.add(said)
        if not self._is_measuring:
            return
        event = status_fields.sent(self.name, said, self.boot, now_s)
        if event is not None:
            self._meter.sent(event._replace(is_probe=text(said, "label").startswith(LABEL)))
        elif text(said, "outcome") in ("dropped", "refused"):
            self._meter.inside.not_sent(self.name, text(said, "interface"), text(said, "reason"))

    def _missed(self, kind: str, said: Mapping[str, object], now_s: float) -> int:
        """Return the number of missed reports of a kind before this one."""
        sequence = round(number(said, "sequence"))
        missed = self._gap(kind, sequence - 1, now_s)
        self._sequences[kind] = sequence
        return missed

    def _gap(self, kind: str, last: int, now_s: float) -> int:
        """Return the number of missed reports if `last` was the latest one.

        A lower number than before means a restart of the station, and no missed reports.
        """
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
            self._given -= self._published()  # the restarted station counts from 0
            self._sequences.clear()
            self._meter.unheard(self.name, math.inf, self.heard_s, now_s)
        self.status = status
        report = within(status, "report")
        self.missed_indications += self._gap("indication", round(number(report, "indications")), now_s)
        self.missed_confirms += self._gap("confirm", round(number(report, "confirms")), now_s)
        for kind in ("indication", "confirm"):
            self._sequences.setdefault(kind, round(number(report, f"{kind}s")))
        self._meter.station(self.name, status_fields.interfaces(status))
        if (position := status_fields.position_of(status)) is not None:
            self._meter.spots.note_station(self.name, now_s, position)
        clock = within(status, "clock")
        quality = status_fields.clock_of(clock, "")
        self.seconds.append(Second(now_s, text(clock, "state"), quality.offset_ns, quality.uncertainty_ns))

    def _to_user(self, message: Message, now_ns: int) -> None:
        digest = digest_of(message.pdu)
        self._delivered(self.name, digest, now_ns)
        raw = message.raw
        is_one_clock = bool(self._own_boot) and self.boot == self._own_boot
        here_ns = time.time_ns() - (time.monotonic_ns() - now_ns) if is_one_clock else None
        self._meter.inside.to_user(self.name, message.type, None if raw is None else raw.received_ns, here_ns)
        position = position_of(message.pdu) if raw is None else position_of(message.pdu, raw.rx.position)
        if position is not None:
            self._meter.spots.note_message(digest, position)


class Own:
    """Confirms of the meter's own messages.

    Counts the interfaces that are to send them, and those that have finished.
    """

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
        """Whether the outcome of this number of messages is known at all interfaces."""
        return self._known >= count and self._over >= self._expected


def _is_another(before: Mapping[str, object], status: Mapping[str, object]) -> bool:
    """Whether a station was restarted.

    Its uptime is compared too, because in a container its process id is always the same.
    """
    is_same = all(before.get(key) == status.get(key) for key in ("boot", "pid"))
    return not is_same or number(status, "uptime_s") < number(before, "uptime_s")


def registered(watches: list[Watch]) -> zmq.Poller:
    """Return a poller for the sockets of all watches."""
    poller = zmq.Poller()
    for watch in watches:
        poller.register(watch.reports, zmq.POLLIN)
        poller.register(watch.users.socket, zmq.POLLIN)
    return poller
