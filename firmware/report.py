"""What the station says about itself, as JSON.

`status.` and `time.` once a second, `confirm.<type>.` for every request, `indication.<type>.` for every message that an
interface has brought.
"""

import json
import math
import os
import resource
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path

from board.loop import Loop
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
FRAME = b"frame."  # see firmware.frames
TOPICS = (CONFIRM, STATUS, TIME, INDICATION, FRAME)
PERIOD_S = 1.0
BUDGET = 10_000  # indications told in a PERIOD_S, 10 us each: five channels at their ceiling
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
    In a flood routing goes first: indications beyond BUDGET in a second are numbered, and not told.
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
        self._told = 0
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

    def _tick(self) -> None:
        self._told = 0
        self._refresh()
        if self._is_time_wanted:
            self._publisher.publish(TIME, json.dumps(self._time_status()).encode())
        if self._is_status_wanted:
            self._say()

    def _say(self) -> None:
        self._said = self._loop.clock()
        self._publisher.publish(STATUS, json.dumps(self._status()).encode())

    def confirm(self, confirm: Confirm, targets: tuple[Interface, ...]) -> None:
        """Publish what became of a request; targets are the interfaces of an accepted one."""
        request = confirm.request
        pdu = request.pdu
        self.confirms += 1
        said = {
            "sequence": self.confirms,
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
            "time": time.time(),
        }
        self._publisher.publish(b"confirm.%s." % request.kind.name.encode(), json.dumps(said).encode())

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

    def observe(self, indications: list[Indication]) -> None:
        """Publish what is known of messages as interfaces have brought them: those that came twice, twice."""
        if self._told >= BUDGET:
            self.indications += len(indications)
            return
        self._told += len(indications)
        said = []
        for one in indications:
            pdu, rx = one.pdu, one.rx
            self.indications += 1
            told = {
                "sequence": self.indications,
                "type": one.kind.name,
                "station_id": int.from_bytes(pdu[2:ITS_HEADER], "big"),
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
            said.append((INDICATION + one.kind.name.encode() + b".", json.dumps(told).encode()))
        self._publisher.publish_all(said)


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
    """Resident memory of this process in kB, from /proc/self/statm (proc(5))."""
    with open("/proc/self/statm", "rb") as statm:
        return int(statm.read().split()[1]) * PAGE_KB


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
