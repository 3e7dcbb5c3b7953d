"""What the station says about itself, as JSON.

`status.` and `time.` once a second, `confirm.<type>.` for every request, `indication.<type>.` for every message of an
interface, `implausible.<type>.` for the implausible ones. Nothing is said of `soon.`: who subscribes to it, too, has
confirms and indications at once.
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

from board.loop import Loop, Timer
from board.time import TimeQuality
from drivers.message import ITS_HEADER, NO_MAC, UNKNOWN_TIME, Confirm, Indication
from drivers.reason import MEANING
from firmware import VERSION
from firmware.interface import Interface
from firmware.publisher import Publisher

CONFIRM = b"confirm."
STATUS = b"status."
TIME = b"time."
INDICATION = b"indication."
IMPLAUSIBLE = b"implausible."
FRAME = b"frame."  # see firmware.frames
SOON = b"soon."
TOPICS = (CONFIRM, STATUS, TIME, INDICATION, IMPLAUSIBLE, FRAME, SOON)
PERIOD_S = 1.0
# Confirms and indications told in a PERIOD_S, 10 us each: two channels at their ceiling, 4 % of a core.
BUDGET = 4_000
# After a second of ten times as many it is less: routing has the rest.
FLOOD, OF_FLOOD = 10 * BUDGET, BUDGET // 4
# Implausible messages told in a PERIOD_S, beside it: forged ones take nothing from confirms and indications.
OF_IMPLAUSIBLE = 100
# They are told: ten times a second libzmq's thread and the subscribers wake, and what routes stays in the processor's
# caches. Who has given a label waits for the word; so may who asks why.
LATER_S, SOON_S = 0.1, 0.01
SLICE = 16  # of them told in one turn: a message that comes meanwhile waits for 0.2 ms
MOST = 4 * BUDGET  # that wait: of what is told in any case more may come than one turn tells
TRIES, NEAR_S = 5, 10e-6  # for two clocks to be read at once: 0.3 us, unless the process is put aside between them
AT_ONCE_S = 0.1  # the least time between two of them, however many subscribe
DIGEST = 16  # hexadecimal digits of a SHA-256: 8 octets tell the messages of a year apart
BOOT = "/proc/sys/kernel/random/boot_id"  # of this boot of this machine: who has the same has the same clock
PAGE_KB = resource.getpagesize() // 1024


class Report:
    """Publishes confirms and indications as they come, status and time once a second; builds none when nobody listens.

    status   makes the status object; time that part of it that is about time.
    refresh  brings counters up to date that the kernel keeps; called once a second, whoever listens.
    quality  of the time, now.

    Confirms and indications are numbered, all types together: who has subscribed to all of them sees what it missed.
    Routing goes first: they are told together, a moment after the message, and in a flood those beyond BUDGET in a
    second, or beyond OF_FLOOD, are numbered only. What did not leave, and what has a label, is told in any case.
    Implausible messages have a budget of their own, OF_IMPLAUSIBLE.

    is_hurried  somebody puts messages together with their indications: they are told in the next turn.
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
        self.confirms = self.indications = self.implausible = 0
        self.is_hurried = False
        self._budget = BUDGET
        self._told = self._numbered = 0  # in this second, and before it
        self._told_implausible = 0  # in this second
        self._waiting: deque[Callable[[], tuple[bytes, bytes]]] = deque()  # what makes topic and body
        self._due, self._timer = math.inf, Timer(math.inf, self._tell)  # when they are told
        self._is_status_wanted = False
        self._is_time_wanted = False
        self._said = loop.clock()

    def start(self) -> None:
        self._loop.every(PERIOD_S, self._tick)

    def status_interest(self, is_wanted: bool) -> None:
        """Somebody subscribed, who need not wait for the next second; or the last one left."""
        self._is_status_wanted = is_wanted
        if is_wanted and self._loop.clock() >= self._said + AT_ONCE_S:
            self._say()

    def time_interest(self, is_wanted: bool) -> None:
        """As status_interest(), but the first comes with the next second."""
        self._is_time_wanted = is_wanted

    def finish(self) -> None:
        """Tell what still waits."""
        self._publish(len(self._waiting))

    def _tick(self) -> None:
        before, self._numbered = self._numbered, self.confirms + self.indications
        self._budget = OF_FLOOD if self._numbered - before > FLOOD else BUDGET
        self._told = self._told_implausible = 0
        self._refresh()
        if self._is_time_wanted:
            self._publisher.publish(TIME, json.dumps(self._time_status()).encode())
        if self._is_status_wanted:
            self._say()

    def _say(self) -> None:
        self._said = self._loop.clock()
        # Takes in what interfaces have brought until now: a status counts it, and comes after it.
        status = self._status()
        self.finish()
        self._publisher.publish(STATUS, json.dumps(status).encode())

    def confirm(self, confirm: Confirm, targets: tuple[Interface, ...]) -> None:
        """Tell soon what became of a request; targets are the interfaces of an accepted one."""
        self.confirms += 1
        is_awaited = confirm.reason is not None or bool(confirm.request.label)
        if self._told < self._budget or is_awaited:
            made = partial(self._confirm_of, self.confirms, time.time(), confirm, targets)
            self._later(made, SOON_S if is_awaited else LATER_S)

    def observe(self, indications: list[Indication]) -> None:
        """Tell soon what is known of messages as interfaces have brought them: those that came twice, twice."""
        for one in indications:
            self.indications += 1
            if self._told < self._budget:
                self._later(partial(self._indication_of, self.indications, one), LATER_S)

    def observe_implausible(self, indications: list[Indication]) -> None:
        """Tell what is known of implausible messages at once: it is to be there before the message itself."""
        for one in indications:
            if one.rx.implausible:
                self.implausible += 1
                if self._told_implausible < OF_IMPLAUSIBLE:
                    self._told_implausible += 1
                    self._publisher.publish(*self._indication_of(self.implausible, one, IMPLAUSIBLE))

    def _later(self, make: Callable[[], tuple[bytes, bytes]], wait_s: float) -> None:
        """Tell it when so much time has gone by at the latest; what has come before it is told before it."""
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
        """A part of what waits; the rest in the turns that follow, with what comes meanwhile."""
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
        request = confirm.request
        pdu = request.pdu
        said = {
            "sequence": number,
            "request": request.number,
            "label": request.label,
            "type": request.kind.name,
            "station_id": int.from_bytes(pdu[2:ITS_HEADER], "big") if len(pdu) >= ITS_HEADER else None,
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
        return b"confirm.%s." % request.kind.name.encode(), json.dumps(said).encode()

    def _indication_of(self, number: int, one: Indication, topic: bytes = INDICATION) -> tuple[bytes, bytes]:
        pdu, rx = one.pdu, one.rx
        said = {
            "sequence": number,
            "type": one.kind.name,
            "station_id": int.from_bytes(pdu[2:ITS_HEADER], "big") if len(pdu) >= ITS_HEADER else None,
            "octets": len(pdu),
            "digest": digest_of(pdu),
            "interface": one.interface,
            "received_ns": one.received_ns,
            "monotonic": one.monotonic,
            "btp_port": rx.btp_port,
            "rssi_dbm": rx.rssi_dbm,
            "source": rx.source or (rx.source_mac.hex(":") if rx.source_mac != NO_MAC else ""),
            "quality": said_of(one.quality),
        }
        if rx.implausible:
            said["implausible"] = rx.implausible
        return topic + one.kind.name.encode() + b".", json.dumps(said).encode()

    def _unix_ns(self, monotonic: float) -> int:
        """Unix time of a moment of the loop's clock: of tries the one in which nothing came between the two clocks."""
        clock, nearest_s, unix_ns = self._loop.clock, math.inf, 0
        for _ in range(TRIES):
            before, now_ns, after = clock(), time.time_ns(), clock()
            if after - before < nearest_s:
                nearest_s = after - before
                unix_ns = now_ns - round(((before + after) / 2 - monotonic) * 1e9)
            if nearest_s < NEAR_S:
                break
        return unix_ns


def digest_of(pdu: bytes) -> str:
    """By which the same message is known in every report."""
    from hashlib import sha256  # with OpenSSL, which nobody else needs

    return sha256(pdu).hexdigest()[:DIGEST]


def said_of(quality: TimeQuality) -> dict[str, object]:
    """How good a time stamp is, as messages say it: true time is offset_ns from it, +- uncertainty_ns."""
    return {
        "state": quality.state.name.lower(),
        "error_ns": quality.error_ns,
        "offset_ns": quality.offset_ns,
        "uncertainty_ns": quality.uncertainty_ns,
    }


def memory_kb() -> int:
    """Resident memory of this process in kB, from /proc/self/statm (proc(5)); 0 where descriptors are used up."""
    try:
        with open("/proc/self/statm", "rb") as statm:
            return int(statm.read().split()[1]) * PAGE_KB
    except OSError:
        return 0


def process_status(started: float, now: float) -> dict[str, object]:
    """The part of the status that is about the process."""
    return {
        "version": VERSION,
        "pid": os.getpid(),
        "boot": boot_id(),
        "time": time.time(),
        "uptime_s": round(now - started, 3),
        "cpu_s": round(time.process_time(), 3),
        "memory_kb": memory_kb(),
    }


@cache
def boot_id() -> str:
    """What tells this boot of this machine from all others; empty where the kernel does not say it."""
    try:
        return Path(BOOT).read_text().strip()
    except OSError:
        return ""
