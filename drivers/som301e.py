"""The Unex SOM301-E as an interface: ITS-G5, with GeoNetworking, BTP and security on the module.

The vendor's library speaks to the module. It is closed, blocks and may crash, so it lives in a process of its own
(v2xcast.py); what ends that costs a restart of this interface and nothing else.
"""

import json
import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar

from board.address import is_ipv4
from board.describe import Range
from board.errors import BlockedError, ConfigurationError, InterfaceError, RequestError, StuckError
from board.loop import Timer
from board.worker import Worker
from drivers import shared_library
from drivers.contract import BUSY, LATER, Can, Capabilities, Host, Sent, Shared
from drivers.message import MAX_PDU, Request, SecurityStatus
from drivers.reason import Reason
from drivers.som301e_handlers import MODES, WORDS, Caster, Handlers, Link
from drivers.wire import v2xcast as wire

# Requests that the library has and has not confirmed. A call takes a millisecond or more; what waits here no DENM
# overtakes, unless it leaves by another caster.
WINDOW = 8

# It answers some 30 s after its power came, and longer after an update of its firmware.
SILENT_S = 120.0

# The process says something every second. One that says nothing is frozen, by a debugger or by the kernel.
SILENCE_S = 5.0

METADATA = frozenset(
    ("btp_port", "rssi_dbm", "data_rate", "traffic_class", "hop_limit", "security", "position", "area", "source_mac")
)

# Of the vehicleCAPTAIN profile: CAM, DENM, MAPEM, SPATEM, IVIM, CPM, RTCMEM, VAM by the ports of TS 103 248.
VEHICLE_CAPTAIN = tuple(
    Caster(caster_id, port) for caster_id, port in enumerate((2001, 2002, 2003, 2004, 2006, 2009, 2013, 2018))
)


@dataclass(frozen=True)
class Som301eOptions:
    """Options of an interface with driver = "som301e".

    library  path of the vendor's libeu_v2xcast.so, which is not part of this program; its name alone: where libraries
             are looked for.
    ip       of the module; the vendor's default, other images have others.
    casters  services of the module that are used, as { caster_id = 0, btp_port = 2001, mode = "both" }.
    silent_s  without one working handler, after which a module in a slot is given a power cycle.
    """

    library: str
    ip: str = "192.168.1.3"
    casters: tuple[Caster, ...] = VEHICLE_CAPTAIN
    silent_s: Annotated[float, Range(60.0, 86_400.0)] = SILENT_S

    def __post_init__(self) -> None:
        if not is_ipv4(self.ip):
            raise ConfigurationError(f'ip: "{self.ip}" is no IPv4 address', "write for example 192.168.1.3")
        if not self.casters:
            raise ConfigurationError("casters: none is named", "leave the option out for the usual ones")
        handlers = Counter((caster.caster_id, mode) for caster in self.casters for mode in MODES[caster.mode])
        for (caster_id, mode), count in handlers.items():
            if count > 1:
                raise ConfigurationError(f"casters: caster_id {caster_id} is used for {WORDS[mode]} {count} times")
        senders = Counter(caster.btp_port for caster in self.casters if caster.transmits)
        for port, count in senders.items():
            if count > 1:
                raise ConfigurationError(f"casters: {count} of them send to BTP port {port}", "let one do so")


class Som301e:
    """PDUs by the casters of a module.

    command    of the process with the library, as Worker has it.
    silence_s  seconds after which a process that says nothing is frozen.
    """

    silence_s: ClassVar[float] = SILENCE_S

    Options: ClassVar[type] = Som301eOptions

    def __init__(self, options: Som301eOptions, shared: Shared, command: Sequence[str] = ()) -> None:
        hears = Can.RECEIVE if any(caster.receives for caster in options.casters) else Can(0)
        self._places = {caster.btp_port: place for place, caster in enumerate(options.casters) if caster.transmits}
        sends = Can.TRANSMIT | Can.GEOBROADCAST if self._places else Can(0)
        self.capabilities = Capabilities(hears | sends, "its-g5", MAX_PDU, METADATA)
        self._options = options
        self._shared = shared
        self._command = command
        self._worker: Worker | None = None
        self._silence: Timer | None = None
        self._restarts = 0
        self._last_error = ""
        self._unusable: tuple[shared_library.Identity, str, str] | None = None  # message and hint
        self._take: dict[int, Callable[[bytes], None]] = {
            wire.RECEIVED: self._received,
            wire.SENT: self._sent,
            wire.STATE: self._state,
            wire.NOTE: self._note,
            wire.COUNTED: self._counted,
            wire.FAULT: self._fault,
            wire.ALIVE: lambda message: None,  # Worker has noted it
        }

    def start(self, host: Host) -> None:
        self._library = library = shared_library.located(self._options.library)
        shared_library.check(library)
        if self._unusable is not None:
            identity, message, hint = self._unusable
            if identity == shared_library.identity(library):
                raise BlockedError(message, hint)
        self._host = host
        self._file = str(Path(library).resolve())  # whose name has the version
        self._kept: dict[int, Request] = {}
        self._is_busy = self._is_telling = False
        self._link: Link | None = None
        self._handlers = Handlers(self._options.casters, self._options.ip)
        self._start_failed = ""
        self._is_starting = True
        self._await_answer()
        self._worker = Worker(
            host.loop, "som301e", self._message, self._changed, command=self._command, silence_s=self.silence_s
        )
        self._worker.start()
        self._is_starting = False
        if self._start_failed:
            self.stop()
            raise InterfaceError(f"the process for {library} {self._start_failed}")

    def send(self, request: Request) -> Sent:
        place = self._places.get(request.btp_port)
        if place is None:
            raise RequestError(f"no caster sends to BTP port {request.btp_port}", "name one in option casters")
        worker = self._worker
        if worker is None or len(self._kept) >= WINDOW or not worker.send(wire.send(place, request)):
            self._is_busy = True
            return BUSY
        self._kept[request.number] = request
        return LATER

    def refresh(self) -> None:
        """Ask what was dropped; the answer is counted when it comes."""
        if self._worker is not None and self._worker.is_up:
            self._worker.send(bytes((wire.COUNT,)))

    def stop(self) -> None:
        """What the process has dropped since refresh() is not known any more: asking would take time."""
        if self._worker is not None:
            worker, self._worker = self._worker, None
            worker.stop()
        self._cancel_silence()

    def _changed(self, is_up: bool, why: str) -> None:
        """The process runs, or has ended."""
        if is_up and self._worker is not None:
            self._worker.send(self._settings())
        elif self._is_starting:
            self._start_failed = _ending(why)
        elif not is_up:
            self._fail(InterfaceError(f"the process for {self._library} {_ending(why)}"))

    def _settings(self) -> bytes:
        """What v2xcast.Settings reads."""
        options, lanes = self._options, self._shared.lanes
        casters = [(caster.caster_id, caster.receives, caster.transmits) for caster in options.casters]
        urgent = sorted(lanes[0]) if lanes else []
        return json.dumps({"library": self._library, "ip": options.ip, "casters": casters, "urgent": urgent}).encode()

    def _fail(self, error: InterfaceError) -> None:
        self._restarts += 1
        self._last_error = error.message
        self.stop()
        self._host.fail(error)

    # What the process says.

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
        place, mode, why_not = wire.parse_state(message)
        self._handlers.set(place, mode, why_not)
        self._failed(why_not or self._last_error)
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
        """Whoever cannot cut a module's power need not give up waiting for it."""
        self._cancel_silence()
        if self._host.slot:
            self._silence = self._host.loop.after(self._options.silent_s, self._stay_silent)

    def _stay_silent(self) -> None:
        message = f"module {self._options.ip} has not answered for {self._options.silent_s:.0f} s: {self._last_error}"
        self._fail(StuckError(message, f"is {self._options.ip} the address that its firmware has?"))

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
            # No try will help before the file is another: the next start says the same at once.
            self._unusable = shared_library.identity(self._library), text, hint
        self._fail((BlockedError if is_library else InterfaceError)(text, hint))

    # What status shows.

    def _failed(self, what: str) -> None:
        """Tell details once a turn, whatever number of handlers has changed in it."""
        self._last_error = what
        if not self._is_telling:
            self._is_telling = True
            self._host.loop.soon(self._tell)

    def _tell(self) -> None:
        self._is_telling = False
        if self._worker is not None:
            self._host.tell(self._details())

    def _details(self) -> Mapping[str, object]:
        return {
            "library": self._file,
            "ip": self._options.ip,
            "casters": self._handlers.details(),
            "restarts": self._restarts,
            "last_error": self._last_error,
        }


def _ending(why: str) -> str:
    """Why a process ended, without what is another each time: the same fault is said once."""
    return re.sub(r"^process \d+ ", "", why.partition("; starts again")[0])
