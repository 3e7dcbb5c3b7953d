"""Reports of the station about itself, in JSON, on port 5558.

`status.` and `time.` are published once a second; `confirm.<type>.` for every request; `indication.<type>.` for every
received message; `implausible.<type>.` for every implausible one. The topic `soon.` carries no message: while it has a
subscriber, confirms and indications are published at once.
"""

import json
import math
import os
import resource
import time
from collections import deque
from collections.abc import Callable, Iterator
from functools import cache, partial
from pathlib import Path

from board.runtime.loop import Loop, Timer
from board.time.scales import TimeQuality
from drivers.message import ITS_HEADER, UNKNOWN_TIME, Confirm, Fault, Indication
from drivers.reason import MEANING, Reason
from firmware import VERSION
from firmware.endpoint.publisher import Publisher
from firmware.routing.interface import Interface

CONFIRM = b"confirm."
STATUS = b"status."
TIME = b"time."
INDICATION = b"indication."
IMPLAUSIBLE = b"implausible."
FRAME = b"frame."  # see firmware.endpoint.frames
SOON = b"soon."
TOPICS = (CONFIRM, STATUS, TIME, INDICATION, IMPLAUSIBLE, FRAME, SOON)
PERIOD_S = 1.0
# Number of confirms and indications published per PERIOD_S, at 10 us each: two full channels, 4 % of a core.
BUDGET = 4_000
# After a second with more than FLOOD confirms and indications, the budget is OF_FLOOD, because routing has priority.
FLOOD, OF_FLOOD = 10 * BUDGET, BUDGET // 4
# Number of implausible messages published per PERIOD_S. Their budget is separate, so that forged messages do not
# displace confirms and indications.
OF_IMPLAUSIBLE = 100
# Seconds until a report is published. With LATER_S, libzmq's thread and the subscribers wake only ten times a second,
# and routing code stays in the processor's caches. Confirms with a label or a reason are published after SOON_S,
# because a user may wait for them.
LATER_S, SOON_S = 0.1, 0.01
SLICE = 16  # number of reports published per turn of the loop: a message that arrives meanwhile waits 0.2 ms
# Number of reports that may wait. It is more than BUDGET, because confirms with a label or a reason have no budget.
MOST = 4 * BUDGET
# Number of attempts to read two clocks at the same time, and the pause between both below which an attempt is good
# enough. An attempt takes 0.3 us, unless the process is preempted.
TRIES, NEAR_S = 5, 10e-6
AT_ONCE_S = 0.1  # least time in seconds between two statuses, however many programs subscribe
DIGEST = 16  # number of hexadecimal digits of a SHA-256: with 8 octets, digests of the messages of a year differ
# File with the kernel's identifier of this boot. Stations with the same identifier share one clock.
BOOT = "/proc/sys/kernel/random/boot_id"
# Reasons to refuse a message in JSON, which has no PDU yet.
OF_JSON = frozenset({Reason.BAD_JSON, Reason.NO_LIBRARY, Reason.FACILITIES_BUSY, Reason.FACILITIES_RESTARTING})
PAGE_KB = resource.getpagesize() // 1024


class Report:
    """Publishes confirms, indications, status and time; builds no report without a subscriber.

    status       returns the status object.
    refresh      updates counters from the kernel; called once a second, even without subscribers.
    time_status  returns the part of the status about time.
    quality      returns the current quality of the station's time.
    is_hurried   True while `soon.` has a subscriber: reports are published in the next turn of the loop.

    Confirms and indications are numbered, all types together, so that a subscriber to all types can detect gaps.
    Routing has priority: reports are published several at a time, shortly after their messages. Those beyond BUDGET per
    second (OF_FLOOD in a flood) are numbered but not published. Confirms with a label or a reason are always published.
    Implausible messages have their own budget, OF_IMPLAUSIBLE.
    """

    def __init__(
        self,
        loop: Loop,
        publisher: Publisher,
        status: Callable[[], dict[str, object]],
        refresh: Callable[[], None],
        time_status: Callable[[], dict[str, object]],
        quality: Callable[[], TimeQuality] = lambda: UNKNOWN_TIME,
    ) -> None:
        self._loop = loop
        self._publisher = publisher
        self._status = status
        self._refresh = refresh
        self._time_status = time_status
        self._quality = quality
        self.confirms = self.indications = 0
        self.implausible = ImplausibleReport(self, publisher)
        self.is_hurried = False
        self._budget = BUDGET
        self._told = self._numbered = 0  # reports published in this second; reports numbered before this second
        self._waiting: deque[Callable[[], tuple[bytes, bytes]]] = deque()  # functions that return topic and body
        self._due, self._timer = math.inf, Timer(math.inf, self._tell)  # time of the next publication
        self._is_status_wanted = False
        self._is_status_due = False
        self._is_time_wanted = False
        self._said = loop.clock()

    def start(self) -> None:
        self._loop.every(PERIOD_S, self._tick)

    def status_interest(self, is_wanted: bool) -> None:
        """Start the status reports at the first subscription, stop them after the last one.

        Each new subscription gets a status at once, or AT_ONCE_S after the previous one: it shows the subscriber that
        its subscriptions have arrived.
        """
        self._is_status_wanted = is_wanted
        if not is_wanted or self._is_status_due:
            return
        if (wait_s := self._said + AT_ONCE_S - self._loop.clock()) <= 0.0:
            self._say()
        else:
            self._is_status_due = True
            self._loop.after(wait_s, self._say_late)

    def time_interest(self, is_wanted: bool) -> None:
        """Start the time reports at the first subscription, with the next second; stop them after the last one."""
        self._is_time_wanted = is_wanted

    def finish(self) -> None:
        """Publish all waiting reports."""
        self._publish(len(self._waiting))

    def _tick(self) -> None:
        before, self._numbered = self._numbered, self.confirms + self.indications
        self._budget = OF_FLOOD if self._numbered - before > FLOOD else BUDGET
        self._told = 0
        self.implausible.begin_second()
        self._refresh()
        if self._is_time_wanted:
            self._publisher.publish(TIME, json.dumps(self._time_status()).encode())
        if self._is_status_wanted:
            self._say()

    def _say_late(self) -> None:
        self._is_status_due = False
        if self._is_status_wanted:
            self._say()

    def _say(self) -> None:
        self._said = self._loop.clock()
        # status() also flushes waiting indications and counts them; their reports are published before the status.
        status = self._status()
        self.finish()
        self._publisher.publish(STATUS, json.dumps(status).encode())

    def confirm(self, confirm: Confirm, targets: tuple[Interface, ...]) -> None:
        """Number a confirm and queue its report within the budget; targets: interfaces of an accepted request."""
        self.confirms += 1
        is_awaited = confirm.reason is not None or bool(confirm.request.label)
        if self._told < self._budget or is_awaited:
            made = partial(self._confirm_of, self.confirms, time.time(), confirm, targets)
            self._later(made, SOON_S if is_awaited else LATER_S)

    def observe(self, indications: list[Indication]) -> None:
        """Number all received messages, duplicates included, and queue their reports within the budget."""
        for one in indications:
            self.indications += 1
            if self._told < self._budget:
                self._later(partial(self.indication_of, self.indications, one), LATER_S)

    def _later(self, make: Callable[[], tuple[bytes, bytes]], wait_s: float) -> None:
        """Queue a report. Reports are published in order; this one after wait_s seconds at the latest."""
        self._told += 1
        self._waiting.append(make)
        if self.is_hurried:
            wait_s = 0.0
        if (due := self._loop.clock() + wait_s) < self._due:
            self._timer.cancel()
            self._due, self._timer = due, self._loop.after(wait_s, self._tell)
        if len(self._waiting) > MOST:
            self._publish(SLICE)

    def _tell(self) -> None:
        """Publish a slice of the waiting reports; the next turns of the loop publish the others."""
        self._publish(SLICE)
        self._due = math.inf
        if self._waiting:
            self._due = -math.inf
            self._loop.soon(self._tell)

    def _publish(self, most: int) -> None:
        self._publisher.publish_all(make() for make in self._taken(most))

    def _taken(self, most: int) -> Iterator[Callable[[], tuple[bytes, bytes]]]:
        for _ in range(min(most, len(self._waiting))):
            yield self._waiting.popleft()

    def _confirm_of(
        self, number: int, when: float, confirm: Confirm, targets: tuple[Interface, ...]
    ) -> tuple[bytes, bytes]:
        """Return topic and body of a confirm.

        sequence     number of the confirm since the start, all types together: a gap shows lost confirms.
        request      number of the request since the start.
        label        `label` of the request's options, or empty.
        type         message type of the PDU.
        station_id   stationID of the PDU; null if the PDU is shorter than its header.
        octets       length of the PDU.
        digest       first 16 hexadecimal digits of the PDU's SHA-256.
        outcome      `accepted` or `refused` by the station; then `sent` or `dropped` by each interface.
        interfaces   interfaces of an accepted request.
        interface    interface that has sent or dropped the request; empty before.
        reason       drop reason; null if accepted or sent.
        meaning      meaning of the reason; null if accepted or sent.
        detail       cause of this drop, if known.
        queue_us     microseconds from the acceptance of the request until the driver got it.
        send_us      microseconds from then until the request had left.
        accepted_ns  Unix time in ns when the station accepted it.
        quality      quality of the station's clock at that time.
        time         Unix time of the confirm, in seconds.
        invalid      all faults of a message in JSON; absent without faults.
        """
        request = confirm.request
        pdu = request.pdu
        said = {
            "sequence": number,
            "request": request.number,
            "label": request.label,
            "type": request.kind.name,
            "station_id": _station_id(pdu) if confirm.reason not in OF_JSON else None,
            "octets": len(pdu),
            "digest": digest_of(pdu),
            "outcome": confirm.outcome.value,
            "interfaces": [interface.name for interface in targets],
            "interface": confirm.interface,
            "reason": confirm.reason,
            "meaning": None if confirm.reason is None else MEANING[confirm.reason],
            "detail": confirm.detail,
            "queue_us": round(confirm.queue_s * 1e6, 1),
            "send_us": round(confirm.send_s * 1e6, 1),
            "accepted_ns": self._unix_ns(request.accepted),
            "quality": said_of(self._quality()),
            "time": when,
        }
        if confirm.invalid:
            said["invalid"] = [invalid_of(fault) for fault in confirm.invalid]
        return b"confirm.%s." % request.kind.name.encode(), json.dumps(said).encode()

    def indication_of(self, number: int, one: Indication, topic: bytes = INDICATION) -> tuple[bytes, bytes]:
        """Return topic and body of an indication.

        sequence    number of the indication since the start, all types together: a gap shows lost indications.
        type        message type of the PDU.
        station_id  stationID of the PDU; null if the PDU is shorter than its header.
        octets      length of the PDU.
        digest      first 16 hexadecimal digits of the PDU's SHA-256. The message itself is on port 5556.
        interface   interface that has received the message.
        received_ns  Unix time of reception in ns; the kernel's time stamp if it stamps packets.
        monotonic   CLOCK_MONOTONIC in seconds when the station processed the message.
        btp_port    BTP port; null if unknown.
        rssi_dbm    signal strength in dBm; null if unknown.
        source      MAC address of the sender, or the sender's name as a client of a broker; empty if unknown.
        quality     quality of `received_ns`, in the second of reception.
        implausible  reasons why the message is implausible; absent for a plausible message.
        """
        pdu, rx = one.pdu, one.rx
        said = {
            "sequence": number,
            "type": one.kind.name,
            "station_id": _station_id(pdu),
            "octets": len(pdu),
            "digest": digest_of(pdu),
            "interface": one.interface,
            "received_ns": one.received_ns,
            "monotonic": one.monotonic,
            "btp_port": rx.btp_port,
            "rssi_dbm": rx.rssi_dbm,
            "source": rx.sender,
            "quality": said_of(one.quality),
        }
        if rx.implausible:
            said["implausible"] = rx.implausible
        return topic + one.kind.name.encode() + b".", json.dumps(said).encode()

    def _unix_ns(self, monotonic: float) -> int:
        """Convert a time of the loop's clock to Unix time in ns.

        Both clocks are read up to TRIES times; the attempt with the shortest pause between the two readings is used.
        """
        clock, nearest_s, unix_ns = self._loop.clock, math.inf, 0
        for _ in range(TRIES):
            before, now_ns, after = clock(), time.time_ns(), clock()
            if after - before < nearest_s:
                nearest_s = after - before
                unix_ns = now_ns - round(((before + after) / 2 - monotonic) * 1e9)
            if nearest_s < NEAR_S:
                break
        return unix_ns


class ImplausibleReport:
    """Reports each implausible message at once, so that the report precedes the message itself.

    The messages are numbered; at most OF_IMPLAUSIBLE per second are reported.
    """

    def __init__(self, report: Report, publisher: Publisher) -> None:
        self._report = report
        self._publisher = publisher
        self._count = 0
        self._told = 0  # number of reports in this second

    def begin_second(self) -> None:
        self._told = 0

    def observe(self, indications: list[Indication]) -> None:
        for one in indications:
            if one.rx.implausible:
                self._count += 1
                if self._told < OF_IMPLAUSIBLE:
                    self._told += 1
                    self._publisher.publish(*self._report.indication_of(self._count, one, IMPLAUSIBLE))


def invalid_of(fault: Fault) -> dict[str, object]:
    """Return a fault of a message in JSON.

    path     component, such as `cam.camParameters.basicContainer.stationType`; empty for the whole message.
    problem  problem, with the range of the component.
    value    invalid value; null if it is missing.
    """
    path, problem, value = fault
    return {"path": path, "problem": problem, "value": value}


def _station_id(pdu: bytes) -> int | None:
    return int.from_bytes(pdu[2:ITS_HEADER], "big") if len(pdu) >= ITS_HEADER else None


def digest_of(pdu: bytes) -> str:
    """Return the digest that identifies a message in all reports."""
    from hashlib import sha256  # imported on demand: it loads OpenSSL

    return sha256(pdu).hexdigest()[:DIGEST]


def said_of(quality: TimeQuality) -> dict[str, object]:
    """Return the quality of a time stamp.

    state           `unknown`, `system`, `coarse`, `settling`, `locked` or `holdover`.
    error_ns        largest error of the time stamp in ns, in 99.9 % of cases; null if unknown.
    offset_ns       estimate of true time minus the time stamp in ns; null if unknown.
    uncertainty_ns  largest error of this estimate in ns, in 99.9 % of cases; null if unknown.
    """
    return {
        "state": quality.state.name.lower(),
        "error_ns": quality.error_ns,
        "offset_ns": quality.offset_ns,
        "uncertainty_ns": quality.uncertainty_ns,
    }


def memory_kb() -> int:
    """Return the resident memory of this process in kB, from /proc/self/statm (proc(5)).

    Return 0 if the file cannot be read, as without a free descriptor.
    """
    try:
        with open("/proc/self/statm", "rb") as statm:
            return int(statm.read().split()[1]) * PAGE_KB
    except OSError:
        return 0


def process_status(started: float, now: float) -> dict[str, object]:
    """Return the part of the status about the process.

    version    version of the program.
    pid        process id.
    run        random text of each start of the station: another one shows that it was restarted.
    boot       boot id of the kernel. Stations with the same boot id share one clock. Empty if unknown.
    time       Unix time in seconds.
    uptime_s   seconds since the start.
    cpu_s      processor time in seconds.
    memory_kb  resident memory in kB.
    """
    return {
        "version": VERSION,
        "pid": os.getpid(),
        "run": run_id(),
        "boot": boot_id(),
        "time": time.time(),
        "uptime_s": round(now - started, 3),
        "cpu_s": round(time.process_time(), 3),
        "memory_kb": memory_kb(),
    }


@cache
def run_id() -> str:
    """Return a random text of this process."""
    return os.urandom(8).hex()


@cache
def boot_id() -> str:
    """Return the kernel's identifier of this boot; empty if it is not available."""
    try:
        return Path(BOOT).read_text().strip()
    except OSError:
        return ""
