"""Reception of one subscription: known types, messages, and the number of missed ones."""

from collections.abc import Iterable
from difflib import get_close_matches

from captain_client.message import Message
from captain_client.reports import object_of

WITH_TYPE = ("message", "indication", "confirm")  # kinds of reports whose topics have a message type


def check_types(topics: Iterable[bytes], status: list[bytes]) -> None:
    """Raise ValueError if the station does not know the message type of a topic.

    status  report of the station; without `types` that of an older release, which is not checked.
    """
    told = (object_of(status) or {}).get("types")
    if not isinstance(told, list):
        return
    known = [str(name) for name in told]
    for topic in topics:
        kind, name, *_ = topic.decode().split(".")
        if kind in WITH_TYPE and name and name not in known:
            alike = get_close_matches(name, known, n=1)
            remedy = f"did you mean {alike[0]}?" if alike else f"known: {', '.join(known)}"
            raise ValueError(f"types: {name!r}: unknown to the station; {remedy}")


class Tally:
    """Counts of one client.

    missed     number of messages that its subscriptions have missed, malformed reports included.
    malformed  number of malformed reports.
    """

    def __init__(self) -> None:
        self.missed = 0
        self.malformed = 0


class Sequences:
    """Last sequence number of each message type, which shows missed messages.

    The station counts the messages of a type from its start. It has delivered earlier messages before the subscription,
    so nothing is missed before the first message of a type. After a restart it counts from 1.
    """

    def __init__(self) -> None:
        self._run = ""
        self._is_first_run = True
        self._last: dict[str, int] = {}

    def begin(self, run: str) -> None:
        """Begin with a run of the station, which a status or a message shows. Does nothing if it is the present one."""
        if run != self._run:
            self._is_first_run = not self._run
            self._run = run
            self._last.clear()

    def missed(self, run: str, kind: str, sequence: int) -> int:
        """Return the number of messages of a type that were missed before this one."""
        self.begin(run)
        last = self._last.get(kind, sequence - 1 if self._is_first_run else 0)
        self._last[kind] = sequence
        return max(0, sequence - last - 1)


class Reception:
    """Reader of the messages of one subscription."""

    def __init__(self, tally: Tally) -> None:
        self._tally = tally
        self._sequences = Sequences()

    def begin(self, status: list[bytes]) -> str:
        """Take the status that proves the subscription: later runs are counted from their first message.

        Return the run of the station; empty without one: a station of an older release.
        """
        run = str((object_of(status) or {}).get("run", ""))
        self._sequences.begin(run)
        return run

    def read(self, frames: list[bytes]) -> Message | None:
        """Return the message of a report of topic `message.`; count a malformed one, and return None.

        A malformed report also counts as missed, before the next message of its type.
        """
        try:
            _, _, pdu = frames
            told = object_of(frames) or {}
            run, kind, sequence = str(told["run"]), str(told["type"]), int(told["sequence"])
            message = Message(pdu, told)
        except (KeyError, TypeError, ValueError, OverflowError):
            self._tally.malformed += 1
            return None
        message.missed = self._sequences.missed(run, kind, sequence)
        self._tally.missed += message.missed
        return message
