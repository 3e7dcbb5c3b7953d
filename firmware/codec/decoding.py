"""Octets to what a user is shown: the edition they are of, or why they are of none."""

import json
import re

from board.errors import RequestError
from firmware.codec import causes
from firmware.codec.foreign import message_frame
from firmware.codec.identify import Identifier, Identity, Refusal, Unknown
from firmware.codec.library import Library, editions
from firmware.codec.reading import Pdu

_NOT_ASCII = re.compile(r"[^ -~]")


class UndecodableError(RequestError):
    """Octets that no message of the library takes.

    pdu      the octets and where they stood.
    nearest  the message that came farthest, and its first bad bit; None where none was worth a trial.
    why      what the octets were taken for.
    """

    def __init__(self, pdu: Pdu, nearest: Refusal | None, why: str, cause: str) -> None:
        told = f"{nearest.message.name}: {nearest}" if nearest is not None else why
        super().__init__(f"{pdu.origin}: {told}", cause)
        self.pdu = pdu
        self.nearest = nearest
        self.why = why


class Decoder:
    """Finds the edition of octets among all of the library, or among those that a user asked for.

    edition  as `--edition` has it. Raises RequestError where the library has no such message.
    is_forced  `--force`: ignore the header.
    """

    def __init__(self, library: Library, edition: str | None = None, is_forced: bool = False) -> None:
        self.known = editions(library, edition)
        self._all = editions(library, None)
        self._is_asked = edition is not None
        self._identifier = Identifier(self.known, edition is not None, self._all, is_forced)

    def find(self, octets: bytes, port: int | None = None, is_quick: bool = False) -> Identity | Unknown:
        """What octets are; is_quick leaves out which other editions give them back as well."""
        return self._identifier.identify(octets, port, is_quick)

    def identify(self, pdu: Pdu, is_quick: bool = False) -> Identity:
        """The same of a PDU. Raises UndecodableError with the likeliest cause."""
        other = message_frame(pdu.octets)
        if other is not None and not self._is_expected(pdu.octets):
            raise UndecodableError(pdu, None, other, "")
        found = self.find(pdu.octets, pdu.port, is_quick)
        if isinstance(found, Identity):
            return found
        cause = found.remedy or causes.likeliest(causes.Case(pdu.octets, self._all, found.nearest, pdu.port))
        raise UndecodableError(pdu, found.nearest, found.why, cause)

    def _is_expected(self, octets: bytes) -> bool:
        """Did the user ask for an edition, or does the header announce a message of the library?"""
        return self._is_asked or any(octets[0] in one.versions and octets[1] in one.ids for one in self._all)


def record(pdu: Pdu, found: Identity) -> str:
    """A decoded message as one line of JSON, from which `captain encode` makes the same octets again."""
    head: dict[str, object] = {
        "edition": found.message.name,
        "type": found.message.type,
        "why": found.why,
        "candidates": [message.name for message in found.exact] or [found.message.name],
        "origin": pdu.origin,
        "octets": len(pdu.octets),
    }
    head |= _way(pdu) | doubt_record(found)
    if not found.is_exact:
        head |= {"is_exact": False, "hex": pdu.octets.hex()}
    return joined(head, "message", found.message.to_json(pdu.octets))


def doubt_record(found: Identity) -> dict[str, object]:
    """Return the members that say why the values may be wrong; empty if there is no doubt."""
    if not found.doubt:
        return {}
    told: dict[str, object] = {"warning": found.doubt}
    return told | {"others": [message.name for message in found.others]} if found.others else told


def error_record(error: RequestError) -> dict[str, object]:
    """What is no message, as one line of JSON shows it."""
    told: dict[str, object] = {"reason": error.message, "remedy": error.hint}
    if not isinstance(error, UndecodableError):
        return {"error": told}
    return {
        "origin": error.pdu.origin,
        "octets": len(error.pdu.octets),
        **_way(error.pdu),
        "hex": error.pdu.octets.hex(),
        "error": refusal_record(error),
    }


def refusal_record(error: UndecodableError) -> dict[str, object]:
    """The member `error` of a message that does not decode."""
    told: dict[str, object] = {"reason": error.why, "cause": error.hint}
    if error.nearest is None:
        return told
    message, path, bit, reason = error.nearest
    return told | {"edition": message.name, "path": path, "bit": bit, "reason": reason}


def joined(head: dict[str, object], key: str, text: str) -> str:
    """An object with one more member, which is JSON already. ASCII: a terminal obeys some of the other characters."""
    safe = _NOT_ASCII.sub(lambda found: json.dumps(found[0])[1:-1], text)
    return f"{json.dumps(head)[:-1]}, {json.dumps(key)}: {safe}}}"


def _way(pdu: Pdu) -> dict[str, object]:
    """What is known of how it came."""
    known = {
        "btp_port": pdu.port,
        "received": None if pdu.when_ns is None else pdu.when_ns // 1000 / 1e6,
        "carried": pdu.carried or None,
    }
    return {key: value for key, value in known.items() if value is not None}
