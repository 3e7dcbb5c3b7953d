"""Routing of received messages to handlers, by messageID, protocolVersion and trial decoding."""

from collections.abc import Iterable
from typing import Generic, Protocol, TypeVar

from .codec import Edition


class HasEdition(Protocol):
    @property
    def edition(self) -> Edition: ...


One = TypeVar("One", bound=HasEdition)


class Routing(Generic[One]):
    """Handlers by messageID. Several handlers with the same messageID are tried in the given order."""

    def __init__(self, handlers: Iterable[One]) -> None:
        self._by_id: list[list[One]] = [[] for _ in range(256)]
        for handler in handlers:
            for number in handler.edition.message.ids:
                self._by_id[number].append(handler)

    def find(self, pdu: bytes) -> One | None:
        """Return the handler of a message; None if none has its messageID. pdu: at least 6 octets."""
        return self.find_edition(pdu)[0]

    def find_edition(self, pdu: bytes) -> tuple[One | None, Edition | None]:
        """Return the handler of a message, and the form of its edition (Edition.of) if that was determined.

        Handlers whose edition has the message's protocolVersion come first. Of these, the order of preference is:
        1. re-encoding gives the same octets, and every part is known;
        2. re-encoding gives the same octets;
        3. it decodes;
        4. the first, which then reports the error.
        """
        candidates = self._by_id[pdu[1]]
        if len(candidates) < 2:
            return (candidates[0] if candidates else None), None
        announced = [one for one in candidates if pdu[0] in one.edition.message.versions] or candidates
        if len(announced) == 1:
            return announced[0], None
        exact, decoded = None, None
        for one in announced:
            edition = one.edition.of(pdu)
            is_exact = edition.is_exact(pdu)
            if is_exact and edition.unknown_parts(pdu) == 0:
                return one, edition
            exact = exact or ((one, edition) if is_exact else None)
            decoded = decoded or ((one, edition) if is_exact is not None else None)
        return exact or decoded or (announced[0], None)
