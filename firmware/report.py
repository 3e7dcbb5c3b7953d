"""What the station says about itself, as JSON: `status.` once a second, `confirm.<type>.` for every request."""

import json
import os
import resource
import time
from collections.abc import Callable

from board.loop import Loop
from drivers.message import ITS_HEADER, Confirm
from drivers.reason import MEANING
from firmware import VERSION
from firmware.interface import Interface
from firmware.publisher import Publisher

CONFIRM = b"confirm."
STATUS = b"status."
PERIOD_S = 1.0
AT_ONCE_S = 0.1  # the least time between two of them, however many subscribe
PAGE_KB = resource.getpagesize() // 1024


class Report:
    """Publishes confirms as they come and the status once a second; builds neither when nobody listens.

    status   makes the status object.
    refresh  brings counters up to date that the kernel keeps; called once a second, whoever listens.
    """

    def __init__(
        self,
        loop: Loop,
        publisher: Publisher,
        status: Callable[[], dict[str, object]],
        refresh: Callable[[], None],
    ) -> None:
        self._loop = loop
        self._publisher = publisher
        self._status = status
        self._refresh = refresh
        self._is_status_wanted = False
        self._said = loop.clock()

    def start(self) -> None:
        self._loop.every(PERIOD_S, self._tick)

    def status_interest(self, is_wanted: bool) -> None:
        """Somebody subscribed, who need not wait for the next second; or the last one left."""
        self._is_status_wanted = is_wanted
        if is_wanted and self._loop.clock() >= self._said + AT_ONCE_S:
            self._say()

    def _tick(self) -> None:
        self._refresh()
        if self._is_status_wanted:
            self._say()

    def _say(self) -> None:
        self._said = self._loop.clock()
        self._publisher.publish(STATUS, json.dumps(self._status()).encode())

    def confirm(self, confirm: Confirm, targets: tuple[Interface, ...]) -> None:
        """Publish what became of a request; targets are the interfaces of an accepted one."""
        request = confirm.request
        pdu = request.pdu
        said = {
            "request": request.number,
            "label": request.label,
            "type": request.kind.name,
            "station_id": int.from_bytes(pdu[2:ITS_HEADER], "big") if len(pdu) >= ITS_HEADER else None,
            "octets": len(pdu),
            "outcome": confirm.outcome.value,
            "interfaces": [interface.name for interface in targets],
            "interface": confirm.interface,
            "reason": confirm.reason,
            "meaning": None if confirm.reason is None else MEANING[confirm.reason],
            "detail": confirm.detail,
            "queue_us": round(confirm.queue_s * 1e6, 1),
            "send_us": round(confirm.send_s * 1e6, 1),
            "time": time.time(),
        }
        self._publisher.publish(b"confirm.%s." % request.kind.name.encode(), json.dumps(said).encode())


def memory_kb() -> int:
    """Resident memory of this process in kB, from /proc/self/statm (proc(5))."""
    with open("/proc/self/statm", "rb") as statm:
        return int(statm.read().split()[1]) * PAGE_KB


def process_status(started: float, now: float) -> dict[str, object]:
    """The part of the status that is about the process."""
    return {
        "version": VERSION,
        "pid": os.getpid(),
        "time": time.time(),
        "uptime_s": round(now - started, 3),
        "cpu_s": round(time.process_time(), 3),
        "memory_kb": memory_kb(),
    }
