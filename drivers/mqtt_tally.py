"""What an MQTT session has counted, told the station once a beat."""

from collections import Counter
from collections.abc import Callable, Mapping

from drivers.reason import Reason
from drivers.wire import v2n_talk as talk


class Tally:
    """Drops that the station has not heard of, and counts since the process began.

    received     messages that were passed on.
    connections  that were accepted.
    last_error   why the last connection ended or did not begin.
    """

    def __init__(self) -> None:
        self.received = self.connections = 0
        self.last_error = ""
        self._drops: Counter[Reason] = Counter()
        self._samples: dict[Reason, tuple[bytes, str]] = {}
        self._in_part = 0, ""
        self._noted = 0, ""
        self._told: dict[str, object] = {}

    def drop(self, reason: Reason, sample: bytes, count: int = 1, why: str = "") -> None:
        """Count a discard; keep its octets, and why just this one."""
        self._drops[reason] += count
        self._samples[reason] = sample[: talk.MAX_SAMPLE], why

    def publish_in_part(self, why: str) -> None:
        """A message is published in some forms of its profile, and why it is not in the others."""
        count, _ = self._in_part
        self._in_part = count + 1, why

    def note(self, text: str) -> None:
        """A message was taken, and something in it read in another unit than the standard's."""
        count, _ = self._noted
        self._noted = count + 1, text

    def tell(self, say: Callable[[bytes], bool], of_session: Mapping[str, object]) -> None:
        """DROPPED for each reason that was met since the last time, and DETAILS where they have changed.

        say  whether it was taken: what was not is told with the next.
        """
        for reason, count in tuple(self._drops.items()):
            if say(talk.dropped(reason, count, *self._samples[reason])):
                del self._drops[reason]
        found = {
            "connections": self.connections,
            "received": self.received,
            **of_session,
            "last_error": self.last_error,
        }
        count, why = self._in_part
        if count:
            found |= {"published_in_part": count, "why_in_part": why}
        count, note = self._noted
        if count:
            found |= {"received_with_note": count, "note": note}
        if found != self._told and say(talk.details(found)):
            self._told = found
