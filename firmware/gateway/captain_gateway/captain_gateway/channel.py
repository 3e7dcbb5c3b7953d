"""Channel: a handler at runtime, with topics, settings, message flow and counters."""

import math
import time
from typing import Any, Protocol

from . import filters, lists, metadata
from .buffer import Buffer
from .codec import Edition, Made
from .counts import Complaints, Counts
from .errors import RefusedError
from .filters import Place
from .handlers.kind import Kind
from .pairing import Arrival
from .settings import Receive, Transmit

STATION_ID = slice(2, 6)  # octets of the stationID in the ITS PDU header


class Sends(Protocol):
    """Callable that sends a message to the station. label: chosen by the user. Raises RefusedError."""

    def __call__(self, channel: "Channel", pdu: bytes, asked: dict[str, object], label: str) -> None: ...


class Logs(Protocol):
    def __call__(self, line: str) -> None: ...


class Surroundings(Protocol):
    """State that a channel reads: own position in degrees, and leap seconds since 2004."""

    @property
    def place(self) -> Place | None: ...
    @property
    def leap_seconds(self) -> int: ...


class Channel:
    """A handler at runtime: edition, settings, counters, and message flow in both directions.

    values                   values of its parameters as ROS has them; source of `receiving` and `transmitting`
    publisher, subscription  objects of rclpy, set by the node; likewise metadata and timer
    frame                    frame_id in the header of list messages; None if topics carry single messages

    The receiving thread calls receive() and confirmed(), the executor's thread all other methods. A changed setting
    replaces the whole settings object, so no lock is needed.
    """

    def __init__(
        self, kind: Kind, edition: Edition, receiving: Receive, transmitting: Transmit, around: Surroundings,
        complaints: Complaints, warn: Logs,
    ) -> None:  # fmt: skip
        self.kind = kind
        self.edition = edition
        self.values: dict[str, Any] = {}
        self.receiving = receiving
        self.transmitting = transmitting
        self.counts = Counts()
        self.station_id = 0
        self.frame: bytes | None = None
        self.publisher: Any = None
        self.metadata: Any = None
        self.send: Sends | None = None
        self.subscription: Any = None
        self.timer: Any = None
        self._around = around
        self._buffer: Buffer[bytes] = Buffer()
        self._complaints = complaints
        self._warn = warn
        self._sequence = 0

    # -- from the station

    def receive(self, arrival: Arrival, edition: Edition | None = None) -> metadata.Note | None:
        """Publish a received message. Returns a Note for its metadata; None if it was refused or metadata has no
        subscriber.

        edition  found by the routing; None: determine it here.
        """
        self.counts.received += 1
        try:
            self._check(arrival.pdu)
            edition = edition or self.edition.of(arrival.pdu)
            made = self._made(arrival.pdu, edition)
        except RefusedError as error:
            self.counts.not_published[error.cause] += 1
            if error.cause in ("undecodable", "edition"):
                self.counts.why_not_published = f"{error}: {arrival.pdu[:16].hex()}..."
                self._complain("received", error.cause, f"not published: {error}")
            return None
        published_ns = time.time_ns()
        self.publisher.publish(self._listed(made.cdr, arrival, published_ns))
        self.counts.published += 1
        self.counts.left_out += bool(made.left_out)
        self._doubt(arrival.pdu, edition)
        self._sequence += 1
        if self.metadata is None or not self.metadata.get_subscription_count():
            return None
        return metadata.Note(self._sequence, arrival.pdu, arrival.reception, edition.name, made.left_out, published_ns)

    def _check(self, pdu: bytes) -> None:
        if not self.receiving.active:
            raise RefusedError("inactive", "receive.active is false")
        self.edition.check_header(pdu)

    def _made(self, pdu: bytes, edition: Edition) -> Made:
        settings = self.receiving
        try:
            why = filters.refusal(pdu, edition, settings, self._around.place)
            if why is None and settings.max_age_s:
                now = filters.its_ms(time.time(), self._around.leap_seconds)
                why = "age" if filters.is_old(pdu, edition, self.kind.clock, settings.max_age_s, now) else None
        except (ValueError, MemoryError) as error:
            raise RefusedError("undecodable", str(error)) from error
        if why is not None:
            raise RefusedError(why, why)
        return edition.to_cdr(pdu)

    def _doubt(self, pdu: bytes, edition: Edition) -> None:
        """Report editions of the same header that decode to different values."""
        if others := edition.others(pdu):
            self.counts.doubtful += 1
            named = f"{' and '.join(others)} decode{'s' * (len(others) == 1)} it to different values"
            text = f"published as {edition.name}, but {named}: {pdu[:16].hex()}..."
            self._complain("received", "doubtful", text)

    def _listed(self, cdr: bytes, arrival: Arrival, published_ns: int) -> bytes:
        """Return the message as its topic carries it: alone, or inside a list.

        A list is stamped with the time of reception; with the time of publication if that is unknown.
        """
        if self.frame is None:
            return cdr
        return lists.wrap(cdr, arrival.reception.received_ns if arrival.reception else published_ns, self.frame)

    # -- from ROS

    def transmit(self, cdr: bytes) -> None:
        """Encode a message from ROS and send it, or queue it if a rate is set. Count and log a refused one."""
        self.counts.taken += 1
        settings = self.transmitting
        if not settings.active:
            self.counts.not_sent["inactive"] += 1
            return
        try:
            pdu = self.octets(cdr if self.frame is None else lists.unwrap(cdr))
            if not settings.rate_hz:
                self.hand_over(pdu)
                return
            for _ in self._buffer.put(self._key(pdu), pdu, time.monotonic(), settings):
                self.counts.not_sent["replaced" if settings.buffer == "latest" else "buffer-full"] += 1
        except RefusedError as error:
            self.refused(error)

    def octets(self, cdr: bytes) -> bytes:
        """Return the PDU of a serialised ROS message. Raises RefusedError with field, value and range."""
        return self.checked(self.edition.from_cdr(cdr))

    def checked(self, pdu: bytes) -> bytes:
        """Return a PDU with the configured stationID, if any.

        Raises RefusedError if its header is not of this edition.
        """
        self.edition.check(pdu)
        if self.station_id:
            pdu = pdu[: STATION_ID.start] + self.station_id.to_bytes(4, "big") + pdu[STATION_ID.stop :]
        return pdu

    def hand_over(self, pdu: bytes, asked: dict[str, object] | None = None, label: str = "") -> None:
        """Send a PDU. Options in `asked` override those of the parameters. Raises RefusedError."""
        assert self.send is not None
        self.send(self, pdu, self.transmitting.options() | (asked or {}), label)
        self.counts.sent += 1

    def refused(self, error: RefusedError) -> None:
        self.counts.not_sent[error.cause] += 1
        self.counts.why_not_sent = str(error)
        self._complain("transmitted", error.cause, f"not sent: {error}")

    def period(self) -> None:
        """Send the messages that are due. Called every 1 / rate_hz seconds."""
        for pdu in self._buffer.due(time.monotonic(), self.transmitting):
            try:
                self.hand_over(pdu)
            except RefusedError as error:
                self.refused(error)

    def set_transmitting(self, settings: Transmit) -> None:
        """Replace the settings. Messages in a queue that these do not use are dropped and counted as not sent."""
        before, self.transmitting = self.transmitting, settings
        if not settings.rate_hz or settings.buffer != before.buffer or not settings.active:
            for _ in self._buffer.clear():
                self.counts.not_sent["settings"] += 1

    def confirmed(self, told: dict[str, object]) -> None:
        """Count a confirm from the station for a message of this handler; log if refused or dropped."""
        outcome = str(told.get("outcome", ""))
        self.counts.outcomes[outcome] += 1
        if outcome not in ("refused", "dropped"):
            return
        where = f" by {told['interface']}" if told.get("interface") else " by the station"
        words = told.get("detail") or told.get("meaning") or ""
        self.counts.why_refused = f"{outcome}{where}: {told.get('reason')} ({words})"
        self._complain("transmitted", f"{outcome} {told.get('reason')}", self.counts.why_refused)

    def _key(self, pdu: bytes) -> object:
        return pdu[STATION_ID] if self.edition.key is None else (pdu[STATION_ID], *self.edition.key(pdu))

    def _complain(self, way: str, cause: str, text: str) -> None:
        line = self._complaints.say(f"{self.kind.name}/{way}", cause, text, time.monotonic())
        if line is not None:
            self._warn(line)


def period_s(settings: Transmit) -> float:
    """Return the seconds between two sendings; infinite without a rate."""
    return 1.0 / settings.rate_hz if settings.rate_hz else math.inf
