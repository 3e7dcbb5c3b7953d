"""Uplink to a broker: waits for the clock, then supervises the client process."""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from board.runtime.errors import BlockedError, InterfaceError
from board.runtime.loop import Timer
from board.runtime.worker import Worker
from drivers.contract import BUSY, LATER, Host, Sent, Shared
from drivers.message import Ego, Request, RxInfo
from drivers.mqtt.client.settings import settings_of
from drivers.mqtt.options import FileStamps, MqttOptions
from drivers.wire.v2n import talk as wire

# The uplink waits for a set clock: the validity of a broker's certificate is checked by the clock, and sent messages
# contain its time.
CLOCK_S = 1.0  # interval of the checks if the clock is set
CLOCKLESS = "waits until the clock of this machine is set; `captain time` shows its state"

# Interval of reports of the own state to the process. Each change is reported, without a threshold, which would report
# a slow vehicle too late at the edge of a tile.
EGO_S = 1.0


class Bearer(NamedTuple):
    """State of the bearer interface."""

    state: str = "down"
    device: str = ""
    why: str = "not started"

    @property
    def is_up(self) -> bool:
        return self.state == "up"

    def link(self, name: str) -> wire.Link:
        """Link of an uplink whose bearer, called name, is not up."""
        if self.state == "starting":
            return wire.Link(False, f"waits for bearer {name}: {self.why}", is_starting=True)
        return wire.Link(False, f"bearer {name} is down: {self.why}")


class ClientHistory:
    """State of the client that survives a stop.

    restarts    number of failures of the process.
    last_error  last failure of the process in words, for status.
    stamps      stamps of the files that the process reads, taken before its start.
    unusable    stamps of the files with which the process failed, with message and hint; None without such a failure.
    parting     process that was stopped last.
    """

    def __init__(self) -> None:
        self.restarts = 0
        self.last_error = ""
        self.stamps: FileStamps = ()
        self.unusable: tuple[FileStamps, str, str] | None = None
        self.parting: Worker | None = None


class Uplink:
    """State between start() and stop(): one process, and its requests.

    kept       requests that the process has not confirmed yet, by number.
    command    command line of the process, for Worker; empty: this program.
    silence_s  seconds without a message after which the process counts as frozen.
    """

    def __init__(
        self,
        options: MqttOptions,
        shared: Shared,
        host: Host,
        history: ClientHistory,
        command: Sequence[str],
        silence_s: float,
    ) -> None:
        self.kept: dict[int, Request] = {}
        self._options = options
        self._shared = shared
        self._host = host
        self._history = history
        self._command = command
        self._silence_s = silence_s
        self._worker: Worker | None = None  # None until the clock is set
        self._start_failed = ""
        self._is_starting = self._is_busy = False
        self._bearer = Bearer()
        self._is_bearer_told = True
        self._said: wire.Link | None = None  # last link that the process reported
        self._link: wire.Link | None = None  # last link reported to the host
        self._ego: Ego | None = None  # last own state sent to the process, with its time set to 0
        self._details: Mapping[str, object] = {}
        self._timer: Timer | None = None
        self._take: dict[int, Callable[[bytes], None]] = {
            wire.RECEIVED: self._received,
            wire.SENT: self._sent,
            wire.STATE: self._state,
            wire.DROPPED: self._dropped,
            wire.DETAILS: self._told,
            wire.FAULT: self._fault,
            wire.ALIVE: lambda message: None,  # a sign of life only, which Worker has already noted
        }

    def start(self) -> None:
        """Start the process, or wait for the clock. Raises InterfaceError if the process cannot be started."""
        if self._shared.is_clock_set():
            self._begin()
        else:
            self._await_clock()

    def send(self, request: Request) -> Sent:
        """Pass a request to the process."""
        worker = self._worker
        if worker is None or len(self.kept) >= self._options.max_in_flight or not worker.send(_message(request)):
            self._is_busy = True
            return BUSY
        self.kept[request.number] = request
        return LATER

    def stop(self) -> None:
        """Let the process disconnect from the broker and end; idempotent."""
        if self._worker is not None:
            parting, self._worker = self._worker, None
            self._history.parting = parting
            parting.send(wire.LEAVE_NOW)
            parting.stop()
        if self._timer is not None:
            self._timer.cancel()

    def bearer_changed(self, state: str, device: str, why: str) -> None:
        """Report the state and network device of the bearer to the process, if it runs."""
        if self._worker is None:
            return
        before, self._bearer = self._bearer, Bearer(state, device, why)
        if self._bearer.is_up or before.is_up:
            self._tell_bearer()
        if self._bearer.is_up and not before.is_up:
            self._said = None  # outdated: the process was waiting for the bearer
        self._show_link()

    def _await_clock(self) -> None:
        if not self._shared.is_clock_set():
            self._timer = self._host.loop.after(CLOCK_S, self._await_clock)
            self._show(wire.Link(False, CLOCKLESS, is_starting=True))
            return
        try:
            self._begin()
        except InterfaceError as error:
            self._fail(error)
        else:
            self._writable()  # send() has returned BUSY until now

    def _begin(self) -> None:
        """Start the process. Raises InterfaceError if it cannot be started."""
        self._is_starting = True
        self._worker = Worker(
            self._host.loop, "mqtt", self._message, self._changed, self._writable, command=self._command,
            silence_s=self._silence_s,
        )  # fmt: skip
        self._worker.start()
        self._is_starting = False
        if self._start_failed:
            self.stop()
            raise InterfaceError(f"the process with the MQTT client {self._start_failed}")

    def _changed(self, is_up: bool, why: str) -> None:
        """Take note that the process has started or ended."""
        if is_up and self._worker is not None:
            self._worker.send(settings_of(self._options, self._shared).message())
            self._tell_bearer()
            self._tell_ego()
        elif self._is_starting:
            self._start_failed = why.partition("; starts again")[0]
        elif not is_up:
            # The PID is removed, so that repeated faults have the same text and are logged once.
            ending = why.partition("; starts again")[0].removeprefix("process ").lstrip("0123456789 ")
            self._fail(InterfaceError(f"the process with the MQTT client {ending}"))

    def _fail(self, error: InterfaceError) -> None:
        self._history.restarts += 1
        self._history.last_error = error.message
        self.stop()
        self._host.fail(error)

    # Messages to the process.

    def _tell_bearer(self) -> None:
        if self._options.bearer and self._worker is not None and self._worker.is_up:
            self._is_bearer_told = self._worker.send(wire.bearer(self._bearer.is_up, self._bearer.device))

    def _tell_ego(self) -> None:
        if self._worker is None:
            return
        own = self._host.ego()
        timeless = own._replace(its_ms=0)
        if timeless != self._ego and self._worker.send(wire.ego(own)):
            self._ego = timeless
        self._timer = self._host.loop.after(EGO_S, self._tell_ego)

    # Messages of the process.

    def _message(self, message: bytes) -> None:
        self._take[message[0]](message)

    def _received(self, message: bytes) -> None:
        received_ns, (pdu, btp_port, source) = wire.parse_received(message)
        if self._options.requests:
            self._host.request(pdu, btp_port)
        else:
            self._host.indicate(pdu, received_ns, RxInfo(btp_port, source=source))

    def _sent(self, message: bytes) -> None:
        number, reason, why = wire.parse_sent(message)
        self._host.confirm(self.kept.pop(number), reason, why)
        self._writable()

    def _writable(self) -> None:
        if not self._is_bearer_told:
            self._tell_bearer()
        if self._is_busy:
            self._is_busy = False
            self._host.writable()

    def _state(self, message: bytes) -> None:
        self._said = wire.parse_state(message)
        self._show_link()

    def _show_link(self) -> None:
        """Report the link of the process, or that of the bearer while it is not up."""
        if self._options.bearer and not self._bearer.is_up:
            self._show(self._bearer.link(self._options.bearer))
        elif self._said is not None:
            self._show(self._said)

    def _show(self, link: wire.Link) -> None:
        """Report a link that has changed."""
        if link == self._link:
            return
        self._link = link
        if link.is_starting:
            self._host.starting(link.why)
        else:
            self._host.link(link.is_up, link.why)

    def _dropped(self, message: bytes) -> None:
        reason, count, sample, why = wire.parse_dropped(message)
        self._host.drop(reason, sample, count, why)

    def _told(self, message: bytes) -> None:
        self._details = wire.parse_details(message)
        self._tell()

    def _fault(self, message: bytes) -> None:
        text, hint = wire.parse_fault(message)
        # A retry fails again until a file has changed: until then start() raises this error at once.
        self._history.unusable = self._history.stamps, text, hint
        self._fail(BlockedError(text, hint))

    def _tell(self) -> None:
        about = {"broker": self._options.url, "profile": self._options.profile}
        if self._options.bearer:
            about["bearer"] = self._options.bearer
        last_error = self._details.get("last_error") or self._history.last_error
        self._host.report_details(
            {**about, **self._details, "restarts": self._history.restarts, "last_error": last_error}
        )


def _message(request: Request) -> bytes:
    return wire.send(wire.ToSend(request.number, request.deadline, request.btp_port, request.kind.row, request.pdu))
