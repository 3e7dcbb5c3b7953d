"""MQTT as an interface: the same messages by a broker, from wherever a mobile network reaches.

The client lives in a process of its own (mqtt_client.py): names, TCP and TLS block, and a broker may send without end.
What waits while the broker is away waits in the station's queue, with priorities and lifetimes.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import ClassVar, NamedTuple

from board.errors import BlockedError, InterfaceError
from board.loop import Timer
from board.worker import Worker
from drivers.contract import BUSY, LATER, Can, Capabilities, Host, Sent, Shared
from drivers.message import MAX_PDU, Ego, Request, RxInfo
from drivers.mqtt_options import FileStamps, MqttOptions, check_files, file_stamps
from drivers.mqtt_settings import settings_of
from drivers.wire import v2n_talk as wire

METADATA = frozenset(("btp_port", "source"))

# For the broker to be told good-bye when the station ends; over a mobile network, with what was not acknowledged.
PART_S = 0.4

# The process says something every second. One that says nothing is frozen, by a debugger or by the kernel.
SILENCE_S = 5.0

# A broker's certificate is compared with the clock, and what is sent bears its time.
CLOCK_S = 1.0  # between two looks at one that is not set
CLOCKLESS = "waits until the clock of this machine is set; `captain time` says how it is"

# Own state is told so often at most, and where it is another. By how little does not count: a vehicle that creeps over
# the edge of a tile would be late by the time that it takes for the rest.
EGO_S = 1.0


class Link(NamedTuple):
    """Whether the broker is there, and why in words."""

    is_up: bool
    why: str


class Bearer(NamedTuple):
    """How the interface is that the connection goes by."""

    is_up: bool = False
    device: str = ""
    why: str = "not started"


class Mqtt:
    """PDUs by a broker.

    command    of the process with the client, as Worker has it.
    silence_s  seconds after which a process that says nothing is frozen.
    """

    silence_s: ClassVar[float] = SILENCE_S

    Options: ClassVar[type] = MqttOptions

    def __init__(self, options: MqttOptions, shared: Shared, command: Sequence[str] = ()) -> None:
        self.capabilities = Capabilities(Can.RECEIVE | Can.TRANSMIT | Can.ANYWHERE, "mqtt", MAX_PDU, METADATA)
        self.bearer = options.bearer
        self._options = options
        self._shared = shared
        self._command = command
        self._worker: Worker | None = None
        self._parting: Worker | None = None
        self._timer: Timer | None = None
        self._restarts = 0
        self._last_error = ""
        self._stamps: FileStamps = ()  # of the files that the process reads, from before it was started
        self._unusable: tuple[FileStamps, str, str] | None = None  # message and hint
        self._take: dict[int, Callable[[bytes], None]] = {
            wire.RECEIVED: self._received,
            wire.SENT: self._sent,
            wire.STATE: self._state,
            wire.DROPPED: self._dropped,
            wire.DETAILS: self._told,
            wire.FAULT: self._fault,
            wire.ALIVE: lambda message: None,  # Worker has noted it
        }

    def start(self, host: Host) -> None:
        check_files(self._options)
        self._stamps = file_stamps(self._options)
        if self._unusable is not None:
            stamps, message, hint = self._unusable
            if stamps == self._stamps:
                raise BlockedError(message, hint)
        self._host = host
        self._kept: dict[int, Request] = {}
        self._is_busy = False
        self._bearer = Bearer()
        self._is_bearer_told = True
        self._said: Link | None = None  # by the process
        self._link: Link | None = None  # by the driver
        self._ego: Ego | None = None  # as the process was told last, but for its time
        self._details: Mapping[str, object] = {}
        if self._shared.is_clock_set():
            self._begin()
        else:
            self._await_clock()

    def _await_clock(self) -> None:
        if not self._shared.is_clock_set():
            self._timer = self._host.loop.after(CLOCK_S, self._await_clock)
            if self._link is None:
                self._link = Link(False, CLOCKLESS)
                self._host.link(*self._link)
            return
        try:
            self._begin()
        except InterfaceError as error:
            self._fail(error)
        else:
            self._writable()  # requests were refused meanwhile

    def _begin(self) -> None:
        """Start the process. Raises InterfaceError."""
        self._start_failed = ""
        self._is_starting = True
        self._worker = Worker(
            self._host.loop, "mqtt", self._message, self._changed, self._writable, command=self._command,
            silence_s=self.silence_s,
        )  # fmt: skip
        self._worker.start()
        self._is_starting = False
        if self._start_failed:
            self.stop()
            raise InterfaceError(f"the process with the MQTT client {self._start_failed}")

    def send(self, request: Request) -> Sent:
        worker = self._worker
        if worker is None or len(self._kept) >= self._options.max_in_flight or not worker.send(_message(request)):
            self._is_busy = True
            return BUSY
        self._kept[request.number] = request
        return LATER

    def refresh(self) -> None:
        """The process says by itself what it drops."""

    def stop(self) -> None:
        """The process says good-bye to the broker, and is not waited for."""
        if self._worker is not None:
            self._parting, self._worker = self._worker, None
            self._parting.send(wire.LEAVE_NOW)
            self._parting.stop()
        if self._timer is not None:
            self._timer.cancel()

    def part(self) -> None:
        if self._parting is not None:
            self._parting.finish(PART_S)

    def bearer_changed(self, is_up: bool, device: str, why: str) -> None:
        if self._worker is None:
            return
        before, self._bearer = self._bearer, Bearer(is_up, device, why)
        if is_up or before.is_up:
            self._tell_bearer()
        if is_up and not before.is_up:
            self._said = None  # it waited for its bearer
        self._show()

    def _changed(self, is_up: bool, why: str) -> None:
        """The process runs, or has ended."""
        if is_up and self._worker is not None:
            self._worker.send(settings_of(self._options, self._shared).message())
            self._tell_bearer()
            self._tell_ego()
        elif self._is_starting:
            self._start_failed = why.partition("; starts again")[0]
        elif not is_up:
            # Without its number: the same fault is said once.
            ending = why.partition("; starts again")[0].removeprefix("process ").lstrip("0123456789 ")
            self._fail(InterfaceError(f"the process with the MQTT client {ending}"))

    def _fail(self, error: InterfaceError) -> None:
        self._restarts += 1
        self._last_error = error.message
        self.stop()
        self._host.fail(error)

    # What the process is told.

    def _tell_bearer(self) -> None:
        if self.bearer and self._worker is not None and self._worker.is_up:
            self._is_bearer_told = self._worker.send(wire.bearer(self._bearer.is_up, self._bearer.device))

    def _tell_ego(self) -> None:
        if self._worker is None:
            return
        own = self._host.ego()
        timeless = own._replace(its_ms=0)
        if timeless != self._ego and self._worker.send(wire.ego(own)):
            self._ego = timeless
        self._timer = self._host.loop.after(EGO_S, self._tell_ego)

    # What the process says.

    def _message(self, message: bytes) -> None:
        self._take[message[0]](message)

    def _received(self, message: bytes) -> None:
        received_ns, (pdu, btp_port, source) = wire.parse_received(message)
        self._host.indicate(pdu, received_ns, RxInfo(btp_port, source=source))

    def _sent(self, message: bytes) -> None:
        number, reason, why = wire.parse_sent(message)
        self._host.confirm(self._kept.pop(number), reason, why)
        self._writable()

    def _writable(self) -> None:
        if not self._is_bearer_told:
            self._tell_bearer()
        if self._is_busy:
            self._is_busy = False
            self._host.writable()

    def _state(self, message: bytes) -> None:
        self._said = Link(*wire.parse_state(message))
        self._show()

    def _show(self) -> None:
        """Tell the link where it is another one. Without its bearer there is none, whatever the process has said."""
        link = self._said
        if self.bearer and not self._bearer.is_up:
            link = Link(False, f"bearer {self.bearer} is down: {self._bearer.why}")
        if link is not None and link != self._link:
            self._link = link
            self._host.link(*link)

    def _dropped(self, message: bytes) -> None:
        reason, count, sample, why = wire.parse_dropped(message)
        self._host.drop(reason, sample, count, why)

    def _told(self, message: bytes) -> None:
        self._details = wire.parse_details(message)
        self._tell()

    def _fault(self, message: bytes) -> None:
        text, hint = wire.parse_fault(message)
        # No try will help before a file is another: the next start says the same at once.
        self._unusable = self._stamps, text, hint
        self._fail(BlockedError(text, hint))

    def _tell(self) -> None:
        about = {"broker": self._options.url, "profile": self._options.profile}
        if self.bearer:
            about["bearer"] = self.bearer
        last_error = self._details.get("last_error") or self._last_error
        self._host.tell({**about, **self._details, "restarts": self._restarts, "last_error": last_error})


def _message(request: Request) -> bytes:
    return wire.send(wire.ToSend(request.number, request.deadline, request.btp_port, request.kind.row, request.pdu))
