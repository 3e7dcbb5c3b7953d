"""Reports of a session to the station: answers and link at once, counts periodically."""

from collections.abc import Callable, Mapping

from drivers.mqtt.client.tally import Tally
from drivers.wire.v2n import talk


class Report:
    """Reports to the station, including those that the outbox has not accepted yet.

    say     passes a message of wire/v2n/talk.py to the outbox; returns False if it is full. It always accepts SENT and
            RECEIVED.
    broker  address of the broker, which precedes the text about the link.
    """

    def __init__(self, say: Callable[[bytes], bool], broker: str) -> None:
        self.tally = Tally()
        self._say = say
        self._broker = broker
        self._link: talk.Link | None = None
        self._told: talk.Link | None = None
        self._has_spoken = False

    @property
    def why_down(self) -> str:
        """Reason why the link is down; empty while it is up."""
        return self._link.why if self._link and not self._link.is_up else ""

    def send(self, message: bytes) -> bool:
        """Pass a message to the outbox; return False if it is full."""
        self._has_spoken = True
        return self._say(message)

    def link(self, is_up: bool, why: str, is_starting: bool = False) -> None:
        """Report the link if it has changed, so that a broker that never answers does not fill the journal."""
        self._link = talk.Link(is_up, f"{self._broker}: {why}", is_starting)
        self._tell_link()

    def beat(self, of_session: Mapping[str, object]) -> None:
        """Send the reports of every BEAT_S: a link not accepted before, the counts, otherwise a sign of life.

        of_session  details of the session for status.
        """
        self._tell_link()
        self.counts(of_session)
        if not self._has_spoken:
            self._say(talk.ALIVE_NOW)
        self._has_spoken = False

    def counts(self, of_session: Mapping[str, object]) -> None:
        self.tally.report(self.send, of_session)

    def _tell_link(self) -> None:
        if self._link is not None and self._link != self._told and self.send(talk.state(*self._link)):
            self._told = self._link
