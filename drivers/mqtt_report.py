"""What the station is told of its session with a broker: answers and link at once, counts once a beat."""

from collections.abc import Callable, Mapping

from drivers.mqtt_tally import Tally
from drivers.wire import v2n_talk as talk


class Report:
    """What is told, and what the station has not taken yet.

    say     takes messages of v2n_talk; False where it does not, but for SENT and RECEIVED.
    broker  whose link it is, in front of the words about it.
    """

    def __init__(self, say: Callable[[bytes], bool], broker: str) -> None:
        self.tally = Tally()
        self._say = say
        self._broker = broker
        self._link: tuple[bool, str] | None = None
        self._told: tuple[bool, str] | None = None
        self._has_spoken = False

    @property
    def why_down(self) -> str:
        """Why there is no link; empty while there is."""
        return self._link[1] if self._link and not self._link[0] else ""

    def tell(self, message: bytes) -> bool:
        """Whether it was taken."""
        self._has_spoken = True
        return self._say(message)

    def link(self, is_up: bool, why: str) -> None:
        """Tell it where it is another: a broker that never answers fills no journal."""
        self._link = (is_up, f"{self._broker}: {why}")
        self._tell_link()

    def beat(self, of_session: Mapping[str, object]) -> None:
        """What is told every BEAT_S: what was not taken before, what was counted, else that the process lives."""
        self._tell_link()
        self.counts(of_session)
        if not self._has_spoken:
            self._say(talk.ALIVE_NOW)
        self._has_spoken = False

    def counts(self, of_session: Mapping[str, object]) -> None:
        self.tally.tell(self.tell, of_session)

    def _tell_link(self) -> None:
        if self._link is not None and self._link != self._told and self.tell(talk.state(*self._link)):
            self._told = self._link
