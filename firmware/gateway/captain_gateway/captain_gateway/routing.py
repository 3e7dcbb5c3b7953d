"""Which handler a received message is for: by messageID, and between editions by what decodes."""

from collections.abc import Iterable
from typing import Generic, Protocol, TypeVar

from .codec import Edition


class HasEdition(Protocol):
    @property
    def edition(self) -> Edition: ...


One = TypeVar("One", bound=HasEdition)


class Routing(Generic[One]):
    """Handlers by messageID; where several have the same, they are tried in the order that they are given in."""

    def __init__(self, handlers: Iterable[One]) -> None:
        self._by_id: list[list[One]] = [[] for _ in range(256)]
        for handler in handlers:
            for number in handler.edition.message.ids:
                self._by_id[number].append(handler)

    def find(self, pdu: bytes) -> One | None:
        """Whose a message of at least 6 octets is; None where nobody has its messageID."""
        return self.find_edition(pdu)[0]

    def find_edition(self, pdu: bytes) -> tuple[One | None, Edition | None]:
        """Return whose a message is, and its interpretation there (Edition.of) where that had to be found.

        Of several editions those that announce its protocolVersion; of these the first that gives the same octets back
        and knows every part, else one that gives them back, else one that decodes; else the first, which says why.
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
