"""Radio module: a SOM301-E and its worker process, from start to stop.

State table:

# state      meaning                                    event                                -> state
#
# starting   the process loads the library              a handler works                         up
#                                                       no handler works                        down
#                                                       a fault of the library                  stopped: BlockedError
#                                                       silent_s expires, in a slot             stopped: StuckError
# up         at least one handler works                 no handler works any more               down
# down       the process re-creates handlers            a handler works                         up
#                                                       silent_s expires, in a slot             stopped: StuckError
# any        the process ends, is silent for silence_s, or a call hangs -> stopped: InterfaceError; stop() -> stopped

The driver creates one RadioModule for each start() and calls send(), refresh() and stop() on the loop. If the module
ends for another reason than stop(), it calls host.fail(). The supervisor of the interface then stops the driver and
decides on the next start. RadioHistory survives the module. After a BlockedError because of the library, the driver's
start() refuses until the library's file has changed, since an earlier retry would fail again.

The process alone controls its handlers. Each handler has a thread that creates, uses and releases it (handler.py). The
process re-creates a failed handler without the supervisor.

The timer silent_s runs in `starting` and `down`, but only for a module in a slot. Without a slot the station cannot cut
the module's power, so retries continue. Earlier versions retried a hung module for ever and never cut its power.

The watchdog inside the process (watchdog.py) detects a hung call. From outside, Worker kills a frozen process after
silence_s. Earlier versions showed a process stopped by SIGSTOP as up for ever.
"""

import json
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

from board.runtime.errors import BlockedError, InterfaceError, StuckError
from board.runtime.loop import Timer
from board.runtime.worker import Worker
from drivers.contract import BUSY, LATER, Host, Sent, Shared
from drivers.message import Request, SecurityStatus
from drivers.reason import Reason
from drivers.som301e import shared_library
from drivers.som301e.handlers import Handlers, Link
from drivers.som301e.options import Som301eOptions
from drivers.wire import v2xcast as wire

# Most requests that the process has and has not confirmed. Sending one takes a millisecond or more. A DENM cannot
# overtake these requests, unless another caster sends it.
WINDOW = 8

# Seconds without a message after which the process counts as frozen, by a debugger or the kernel. A running process
# sends a message every second.
SILENCE_S = 5.0


class RadioHistory:
    """State of a radio that survives its process.

    restarts    number of failures of the process since the station's start.
    last_error  last error in words, for status; empty before the first.
    unusable    identity of a library that cannot be used, with the error's message and hint; None without one.
    """

    def __init__(self) -> None:
        self.restarts = 0
        self.last_error = ""
        self.unusable: tuple[shared_library.Identity, str, str] | None = None


class RadioProcess(NamedTuple):
    """Command and time limits of the process with the library; tests use others than the default.

    command    command line for Worker; empty: this program.
    silence_s  seconds without a message after which the process counts as frozen; 0: never.
    times      call_s and check_s of process.Settings, if they differ from its defaults.
    """

    command: Sequence[str] = ()
    silence_s: float = SILENCE_S
    times: Mapping[str, float] = MappingProxyType({})


THIS_PROGRAM = RadioProcess()


class RadioModule:
    """State between start() and stop(): one worker process, its requests and handlers.

    library  path of the vendor's library.

    Raises InterfaceError if the process cannot be started.
    """

    def __init__(
        self,
        options: Som301eOptions,
        shared: Shared,
        host: Host,
        library: str,
        history: RadioHistory,
        process: RadioProcess,
    ) -> None:
        self._options = options
        self._shared = shared
        self._host = host
        self._library = library
        self._file = str(Path(library).resolve())  # the name of the file behind symbolic links contains the version
        self._history = history
        self._kept: dict[int, Request] = {}
        self._is_busy = self._is_telling = self._is_stopped = False
        self._link: Link | None = None
        self._handlers = Handlers(options.casters, options.ip)
        self._start_failed = ""
        self._is_starting = True
        self._silence: Timer | None = None
        self._times = process.times
        self._worker = Worker(
            host.loop, "som301e", self._message, self._changed, command=process.command, silence_s=process.silence_s
        )
        self._take: dict[int, Callable[[bytes], None]] = {
            wire.RECEIVED: self._received,
            wire.SENT: self._sent,
            wire.STATE: self._state,
            wire.NOTE: self._note,
            wire.COUNTED: self._counted,
            wire.FAULT: self._fault,
            wire.ALIVE: lambda message: None,  # a sign of life only, which Worker has already noted
        }
        self._await_answer()
        self._worker.start()
        self._is_starting = False
        if self._start_failed:
            self.stop()
            raise InterfaceError(f"the process for {self._library} {self._start_failed}")
        host.starting(f"waiting for module {options.ip}")

    def send(self, index: int, request: Request) -> Sent:
        """Pass a PDU to the process, for the caster with this index."""
        if len(self._kept) >= WINDOW or not self._worker.send(wire.send(index, request)):
            self._is_busy = True
            return BUSY
        self._kept[request.number] = request
        return LATER

    def refresh(self) -> None:
        """Ask the process for its drop count."""
        if self._worker.is_up:
            self._worker.send(bytes((wire.COUNT,)))

    def stop(self) -> None:
        """Stop the process; idempotent."""
        self._is_stopped = True
        self._worker.stop()
        self._cancel_silence()

    def _changed(self, is_up: bool, why: str) -> None:
        """Take note that the process has started or ended."""
        if is_up:
            self._worker.send(self._settings())
        elif self._is_starting:
            self._start_failed = _ending(why)
        elif not is_up:
            self._fail(InterfaceError(f"the process for {self._library} {_ending(why)}"))

    def _settings(self) -> bytes:
        """Return the settings of the process as JSON, in the form of process.Settings."""
        options, lanes = self._options, self._shared.lanes
        casters = [(caster.caster_id, caster.receives, caster.transmits) for caster in options.casters]
        urgent = sorted(lanes[0]) if lanes else []
        told = {"library": self._library, "ip": options.ip, "casters": casters, "urgent": urgent}
        return json.dumps({**told, **self._times}).encode()

    def _fail(self, error: InterfaceError) -> None:
        self._history.restarts += 1
        self._history.last_error = error.message
        self.stop()
        self._host.fail(error)

    # Messages of the process.

    def _message(self, message: bytes) -> None:
        self._take[message[0]](message)

    def _received(self, message: bytes) -> None:
        caster, received_ns, pdu, rx = wire.parse_received(message)
        status = rx.security.status
        if status is SecurityStatus.INVALID_FMT:
            self._host.drop(Reason.SECURED_FORMAT, pdu)
        elif status is SecurityStatus.UNVERIFIABLE_PKT and not self._shared.deliver_unverified:
            self._host.drop(Reason.SECURED, pdu)
        else:
            port = self._options.casters[caster].btp_port
            self._host.indicate(pdu, received_ns, rx._replace(btp_port=port))

    def _sent(self, message: bytes) -> None:
        number, why_not = wire.parse_sent(message)
        request = self._kept.pop(number)
        if why_not:
            self._failed(why_not)
        self._host.confirm(request, Reason.SEND_FAILED if why_not else None)
        if self._is_busy:
            self._is_busy = False
            self._host.writable()

    def _state(self, message: bytes) -> None:
        index, mode, why_not = wire.parse_state(message)
        self._handlers.set(index, mode, why_not)
        self._failed(why_not or self._history.last_error)
        link = self._handlers.link()
        if link is not None and link != self._link:
            was_up = self._link is not None and self._link.is_up
            self._link = link
            if link.is_up:
                self._cancel_silence()
            elif was_up:
                self._await_answer()
            self._host.link(*link)

    def _await_answer(self) -> None:
        """Start the silent_s timer, if the module is in a slot."""
        self._cancel_silence()
        if self._host.slot:
            self._silence = self._host.loop.after(self._options.silent_s, self._stay_silent)

    def _stay_silent(self) -> None:
        message = (
            f"module {self._options.ip} has not answered for {self._options.silent_s:.0f} s: {self._history.last_error}"
        )
        self._fail(StuckError(message, "set ip to the address of the module's firmware"))

    def _cancel_silence(self) -> None:
        if self._silence is not None:
            self._silence.cancel()

    def _note(self, message: bytes) -> None:
        self._failed(wire.parse_note(message))

    def _counted(self, message: bytes) -> None:
        self._host.drop(Reason.RECEIVE_QUEUE, count=wire.parse_counted(message))

    def _fault(self, message: bytes) -> None:
        is_library, text, hint = wire.parse_fault(message)
        if is_library:
            # A retry fails again until the library's file is replaced: until then start() raises this error at once.
            self._history.unusable = shared_library.identity(self._library), text, hint
        self._fail((BlockedError if is_library else InterfaceError)(text, hint))

    # Details of status.

    def _failed(self, what: str) -> None:
        """Note an error; report details at most once per turn of the loop, even if several handlers changed."""
        self._history.last_error = what
        if not self._is_telling:
            self._is_telling = True
            self._host.loop.soon(self._tell)

    def _tell(self) -> None:
        self._is_telling = False
        if not self._is_stopped:
            self._host.report_details(self._details())

    def _details(self) -> Mapping[str, object]:
        return {
            "library": self._file,
            "ip": self._options.ip,
            "casters": self._handlers.details(),
            "restarts": self._history.restarts,
            "last_error": self._history.last_error,
        }


def _ending(why: str) -> str:
    """Return the reason why a process ended, without its PID, so that repeated faults have the same text."""
    return re.sub(r"^process \d+ ", "", why.partition("; starts again")[0])
