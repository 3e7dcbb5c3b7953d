"""Decoding: finds the edition of octets, or the reason why none fits."""

import json
import re

from board.runtime.errors import RequestError
from firmware.codec import causes
from firmware.codec.foreign import message_frame
from firmware.codec.identify import Identifier, Identity, Refusal, Unknown
from firmware.codec.library import Library, editions
from firmware.codec.reading import Pdu
from firmware.printable import failure_record
from firmware.topics import PLAIN

_NOT_ASCII = re.compile(r"[^ -~]")


class UndecodableError(RequestError):
    """Octets that decode as no message of the library.

    pdu      the octets and their place in the input.
    nearest  the message that decoded the most bits, with its first bad bit; None if none was tried.
    why      why this message was tried.
    """

    def __init__(self, pdu: Pdu, nearest: Refusal | None, why: str, cause: str) -> None:
        told = f"{nearest.message.name}: {nearest}" if nearest is not None else why
        super().__init__(f"{pdu.origin}: {told}", cause)
        self.pdu = pdu
        self.nearest = nearest
        self.why = why


class Decoder:
    """Finds the edition of octets, among all editions or those of --edition.

    edition    value of `--edition`. Raises RequestError if the library has no such message.
    is_forced  value of `--force`: ignore the header.
    """

    def __init__(self, library: Library, edition: str | None = None, is_forced: bool = False) -> None:
        self.known = editions(library, edition)
        self._all = editions(library, None)
        self._is_asked = edition is not None
        self._identifier = Identifier(self.known, edition is not None, self._all, is_forced)

    def find(self, octets: bytes, port: int | None = None, is_quick: bool = False) -> Identity | Unknown:
        """Return the edition of octets, or why none fits.

        is_quick: do not search for other editions that fit as well.
        """
        return self._identifier.identify(octets, port, is_quick)

    def identify(self, pdu: Pdu, is_quick: bool = False) -> Identity:
        """Return the edition of a PDU. Raises UndecodableError with the likeliest cause."""
        other = message_frame(pdu.octets)
        if other is not None and not self._is_expected(pdu.octets):
            raise UndecodableError(pdu, None, other, "")
        found = self.find(pdu.octets, pdu.port, is_quick)
        if isinstance(found, Identity):
            return found
        cause = found.remedy or causes.likeliest(causes.Case(pdu.octets, self._all, found.nearest, pdu.port))
        raise UndecodableError(pdu, found.nearest, found.why, cause)

    def _is_expected(self, octets: bytes) -> bool:
        """Return whether the user chose an edition, or the header announces a message of the library."""
        return self._is_asked or any(octets[0] in one.versions and octets[1] in one.ids for one in self._all)


def record(pdu: Pdu, found: Identity, is_plain: bool = False) -> str:
    """Return a decoded message as one line of JSON. `captain encode` converts it back to the same octets.

    is_plain: in the plain dialect.
    """
    head: dict[str, object] = {
        "edition": found.message.name,
        "type": found.message.type,
        "why": found.why,
        "candidates": [message.name for message in found.exact] or [found.message.name],
        "origin": pdu.origin,
        "octets": len(pdu.octets),
    }
    if is_plain:
        head["form"] = PLAIN
    head |= _way(pdu) | doubt_record(found)
    if not found.is_exact:
        head |= {"is_exact": False, "hex": pdu.octets.hex()}
    return joined(head, "message", found.message.to_json(pdu.octets, plain=is_plain))


def doubt_record(found: Identity) -> dict[str, object]:
    """Return the JSON members that say why the values may be wrong; empty without a doubt.

    warning  reason why the values may be wrong; absent without a doubt.
    others   other editions that fit the octets, but decode other values; absent without one.
    """
    if not found.doubt:
        return {}
    told: dict[str, object] = {"warning": found.doubt}
    return told | {"others": [message.name for message in found.others]} if found.others else told


def error_record(error: RequestError) -> dict[str, object]:
    """Return the JSON object for an invalid message."""
    if not isinstance(error, UndecodableError):
        return failure_record(error)
    return {
        "origin": error.pdu.origin,
        "octets": len(error.pdu.octets),
        **_way(error.pdu),
        "hex": error.pdu.octets.hex(),
        **refusal_record(error),
    }


def refusal_record(error: UndecodableError) -> dict[str, object]:
    """Return the JSON members for an undecodable message: `error`, `hint`, and each fact of `error`.

    The member `edition` is omitted, because it names the edition of a decoded message.

    reason           problem of the first invalid component; only with `error`.
    nearest_edition  edition that decodes the most bits; only with `error`.
    path             first invalid component; only with `error`.
    bit              position of this component in the PDU; only with `error`.
    """
    told = failure_record(error)
    if error.nearest is None:
        return told | {"reason": error.why}
    message, path, bit, reason = error.nearest
    return told | {"reason": reason, "nearest_edition": message.name, "path": path, "bit": bit}


def joined(head: dict[str, object], key: str, text: str) -> str:
    """Return a JSON object with one more member, whose value is already JSON text.

    Characters other than printable ASCII are escaped, because terminals execute some of them.
    """
    safe = _NOT_ASCII.sub(lambda found: json.dumps(found[0])[1:-1], text)
    return f"{json.dumps(head)[:-1]}, {json.dumps(key)}: {safe}}}"


def _way(pdu: Pdu) -> dict[str, object]:
    """Return the JSON members about reception: port, time, layers."""
    known = {
        "btp_port": pdu.port,
        "received": None if pdu.when_ns is None else pdu.when_ns // 1000 / 1e6,
        "carried": pdu.carried or None,
    }
    return {key: value for key, value in known.items() if value is not None}
