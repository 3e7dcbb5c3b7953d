"""Message library: imports `captain_messages` on demand, and finds editions."""

import json
import re
from collections.abc import Sequence
from functools import cache
from typing import Any, Protocol

from captain_client.errors import StationError

INSTALL = "install the wheel captain-messages; `make wheels` builds it, and a checkout has it in .venv"


class Edition(Protocol):
    """Message of one edition in the library; asn1/guide/python-functions.md describes it."""

    @property
    def name(self) -> str: ...
    @property
    def type(self) -> str: ...
    @property
    def ids(self) -> Sequence[int]: ...
    @property
    def versions(self) -> Sequence[int]: ...
    @property
    def short_names(self) -> dict[str, str]: ...

    def view(self, octets: bytes, /) -> Any: ...
    def validate(self, value: bytes, /) -> None: ...
    def to_json(self, octets: bytes, /, *, plain: bool = False) -> str: ...
    def leaves(self, octets: bytes, /) -> tuple[bytes, int]: ...
    def type_tree(self) -> Any: ...


class Decoded:
    """Received PDU in the edition that fits best.

    Raises StationError if the library is missing, no edition has the header of the PDU, or the PDU does not decode.
    """

    def __init__(self, pdu: bytes, kind: str) -> None:
        fits = _of_header().get(pdu[:2], [])
        if not fits:
            raise StationError(f"{kind or 'message'}: unknown protocolVersion or messageID: {pdu[:2].hex()}")
        self._pdu = pdu
        self.edition = _best(fits, pdu, kind)
        try:
            self.view = self.edition.view(pdu)
            self.edition.leaves(pdu)  # reads all of the message; a view reads only what is asked of it
        except (ValueError, MemoryError) as error:
            raise StationError(f"{self.edition.name}: {error}") from error

    def exact(self) -> dict[str, Any]:
        """Return the message with the integers of the standard: the dialect `json`."""
        return _object(self.edition.to_json(self._pdu))

    def plain(self) -> dict[str, Any]:
        """Return the message in SI units, degrees and names: the dialect `plain`."""
        return _object(self.edition.to_json(self._pdu, plain=True))

    def path(self, name: str) -> str:
        """Return the path of a short name. A path, and a component of the message, are returned unchanged.

        Raises StationError for an unknown name.
        """
        names = self.edition.short_names
        if "." in name or name in names:
            return names.get(name, name)
        components = [field.name for field in self.edition.type_tree().fields]
        if name.partition("[")[0] not in components:
            known = ", ".join([*names, *components])
            raise StationError(f"{self.edition.name}: unknown name: {name}", f"a path, or one of {known}")
        return name


def value_at(value: Any, path: str) -> Any:
    """Return the component at a path such as `cam.camParameters.x[0].y`; None if it is absent."""
    for step in path.replace("[", ".").replace("]", "").split("."):
        if isinstance(value, dict):
            value = value.get(step)
        elif isinstance(value, list) and step.isdecimal() and int(step) < len(value):
            value = value[int(step)]
        else:
            return None
    return value


def _object(text: str) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(text)
    return found


@cache
def _of_header() -> dict[bytes, list[Edition]]:
    """Return the editions by the first two octets of their PDUs, preferred ones first."""
    try:
        import captain_messages
    except ImportError as error:
        raise StationError("the message library captain_messages is not installed", INSTALL) from error
    found: dict[bytes, list[Edition]] = {}
    editions: Sequence[Edition] = captain_messages.all()
    for one in editions:
        for version in one.versions:
            for number in one.ids:
                found.setdefault(bytes((version, number)), []).append(one)
    return found


def _best(editions: Sequence[Edition], pdu: bytes, kind: str) -> Edition:
    """Return the edition that fits a PDU best. editions: those of its header, preferred ones first.

    It has the type of the envelope, decodes the PDU, and knows most parts of it. Of several such editions, the first
    one whose constraints all hold is returned.
    """
    if len(editions) == 1:
        return editions[0]
    misfits = [_misfit(one, pdu, kind) for one in editions]
    best = [one for one, misfit in zip(editions, misfits, strict=True) if misfit == min(misfits)]
    return next((one for one in best if _is_valid(one, pdu)), best[0])


def _misfit(edition: Edition, pdu: bytes, kind: str) -> tuple[bool, bool, int]:
    is_other = re.sub(r"[.-]", "_", edition.type) != kind
    try:
        return is_other, False, edition.leaves(pdu)[1]
    except (ValueError, MemoryError):
        return is_other, True, 0


def _is_valid(edition: Edition, pdu: bytes) -> bool:
    try:
        edition.validate(pdu)
    except (ValueError, MemoryError):
        return False
    return True
