"""Driver for a GNSS receiver: reports position and the time of pulses; carries no messages."""

import logging
from collections.abc import Mapping
from typing import ClassVar

from board.runtime.errors import RequestError, StationError
from drivers.contract import Answer, Can, Capabilities, Host, Sent, Shared
from drivers.gnss.options import GnssOptions
from drivers.gnss.running import Failures, RunningReceiver
from drivers.message import Request

log = logging.getLogger("captain.gnss")

_CAN = {"ubx": Can.POSITION | Can.TIMEMARK, "nmea": Can.POSITION, "static": Can.POSITION}


class ZedF9p:
    """Driver of a GNSS receiver with its corrections.

    The link is up while the receiver sends epochs, even without a position: a receiver without view of the sky is not
    faulty. Each Fix and the details have the quality of the solution.
    """

    Options: ClassVar[type] = GnssOptions

    def __init__(self, options: GnssOptions, shared: Shared) -> None:
        self.capabilities = Capabilities(_CAN[options.kind], "gnss", 0)
        self._options = options
        self._machine = shared.machine
        self._failures = Failures()
        self._last: RunningReceiver | None = None  # stays after stop(), because operators still query its details

    def start(self, host: Host) -> None:
        self._last = RunningReceiver(self._options, self._machine, host, self._failures)
        self._last.start()

    def send(self, request: Request) -> Sent:
        """Refuse a request. Always raises RequestError: a receiver sends nothing."""
        name = self._last.host.name if self._last else self.capabilities.technology
        raise RequestError(f"{name} is a GNSS receiver, which sends nothing")

    def refresh(self) -> None:
        """Do nothing: this driver counts by itself, and reads no counters of the kernel or the receiver."""

    def stop(self) -> None:
        if self._last is not None:
            self._last.stop()

    def operate(self, do: str, arguments: Mapping[str, object], answer: Answer) -> None:
        """Execute an operator's command: `status` for the details, or `reset` with `kind` hot, warm, cold or full."""
        try:
            answer(self._operate(do, arguments))
        except StationError as error:
            answer(error)

    def _operate(self, do: str, arguments: Mapping[str, object]) -> dict[str, object]:
        if self._last is None:
            raise RequestError("the receiver is not started", "`captain status` shows why")
        if do == "status":
            return self._last.details()
        if do != "reset":
            raise RequestError(f"unknown command of a receiver: {do!r}", "use status or reset")
        kind = str(arguments.get("kind", "hot"))
        self._last.receiver.reset(kind)
        log.info("%s: an operator requested a %s reset of the receiver", self._last.host.name, kind)
        return {"reset": kind}
