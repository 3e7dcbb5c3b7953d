"""Counters of an MQTT session, reported to the station periodically."""

from collections import Counter
from collections.abc import Callable, Mapping

from drivers.reason import Reason
from drivers.wire.v2n import talk


class Tally:
    """Drops that are not reported yet, and counts since the start of the process.

    received     number of messages passed on to the station.
    connections  number of accepted connections.
    last_error   reason why the last connection ended or failed.
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
        """Count discarded messages; keep a sample of the last one, with its explanation."""
        self._drops[reason] += count
        self._samples[reason] = sample[: talk.MAX_SAMPLE], why

    def publish_in_part(self, why: str) -> None:
        """Count a message that is published in only some of the profile's forms; why: the reason for the others."""
        count, _ = self._in_part
        self._in_part = count + 1, why

    def note(self, text: str) -> None:
        """Count a message that was accepted with a note: a value in it was read in another unit than the standard's."""
        count, _ = self._noted
        self._noted = count + 1, text

    def report(self, say: Callable[[bytes], bool], of_session: Mapping[str, object]) -> None:
        """Send DROPPED for each reason counted since the last report, and DETAILS if they have changed.

        say  passes a message on; returns False if it was not accepted: the next report then repeats it.
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
