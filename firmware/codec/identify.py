"""Identification of octets: message type and edition.

It uses the ITS PDU header, the BTP port and trial decoding.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from drivers.message import ITS_HEADER
from drivers.wire.editions import are_forms, compared, is_valid, leaves, names, of_header
from firmware.codec.library import Message
from firmware.topics import LEGACY_VAM

VAM = 16  # messageID (TS 102 894-2, DE MessageId)


class Refusal(NamedTuple):
    """A message that failed to decode. bit: offset of the first invalid value; path: its field."""

    message: Message
    path: str
    bit: int
    reason: str

    def __str__(self) -> str:
        return f"{self.path or 'the message'}: bit {self.bit}: {self.reason}"


class Identity(NamedTuple):
    """Edition of some octets.

    message   preferred edition.
    why       reasons as text.
    is_exact  encoding the decoded message again gives the same octets.
    exact     all editions for which that is true; the preferred one is first.
    others    editions that also fit the octets, but decode to different values.
    doubt     reason why the values may be wrong; may be empty.
    """

    message: Message
    why: str
    is_exact: bool
    exact: tuple[Message, ...]
    others: tuple[Message, ...] = ()
    doubt: str = ""


class Unknown(NamedTuple):
    """Result for octets that decode as no message.

    nearest  message that decoded the most bits; None if none was tried.
    remedy   remedy, if `why` already contains the cause.
    """

    nearest: Refusal | None
    why: str
    remedy: str = ""


class Group(NamedTuple):
    """Candidate messages, with the reason why they are likely. doubt: reason why they may be wrong."""

    why: str
    messages: list[Message]
    is_announced: bool = False  # candidates found by messageID; protocolVersion decides between them
    is_guess: bool = False
    doubt: str = ""


class Try(NamedTuple):
    """Result of decoding the octets as one message, and encoding it again."""

    message: Message
    refusal: Refusal | None
    is_exact: bool


def attempt(message: Message, octets: bytes) -> Try:
    """Decode octets as a message, and encode it again."""
    try:
        view = message.view(octets)
    except (ValueError, MemoryError) as error:
        return Try(message, _refusal(message, error), False)
    try:
        return Try(message, None, message.encode(view) == octets)
    except (ValueError, MemoryError):
        return Try(message, None, False)


def _refusal(message: Message, error: ValueError | MemoryError) -> Refusal:
    """Convert an error of the library. A MemoryError means that the octets ask for too much memory."""
    if isinstance(error, MemoryError):
        return Refusal(message, "", 0, "decoding needs more memory than a message may have")
    path, bit = getattr(error, "path", ""), getattr(error, "bit", 0)
    return Refusal(message, str(path), int(bit), str(getattr(error, "reason", error)))


class Identifier:
    """Finds the message of octets.

    known      candidate messages.
    is_asked   the candidates are those of --edition: the header must be theirs, or that of no edition.
    library    all messages, to recognise headers; default: `known`.
    is_forced  ignore the header, if the user named messages.

    If editions have the header's messageID and protocolVersion, only these are tried. Editions that re-encode to the
    same octets are preferred, then those that know every part, then those of smaller rank. A type that neither header
    nor port announces is a guess: it must re-encode to the same octets and satisfy every constraint of its standard.
    """

    def __init__(
        self,
        known: Sequence[Message],
        is_asked: bool = False,
        library: Sequence[Message] = (),
        is_forced: bool = False,
    ) -> None:
        self._known = known
        self._is_asked = is_asked
        self._library = library or known
        self._is_forced = is_forced

    def identify(self, octets: bytes, port: int | None = None, is_quick: bool = False) -> Identity | Unknown:
        """Return type and edition of octets.

        port      BTP port on which they were received; None if unknown.
        is_quick  return the first edition that re-encodes to the same octets: `exact` and `others` then list no more.
        """
        if self._is_asked and not self._is_forced:
            owners = of_header(self._library, octets)
            if owners and not of_header(self._known, octets):
                return _of_others(owners, self._known, octets)
        refused: list[Refusal] = []
        why = f"no message has messageID {octets[1]}" if len(octets) > 1 else "it has no ITS PDU header"
        for group in self._groups(octets, port):
            tries = _tries(group, octets, is_quick)
            decoded = [one for one in tries if one.refusal is None and (not group.is_guess or _is_sound(one, octets))]
            if decoded:
                return _identity(group, tries, decoded, octets, self._port_of_others(decoded, port))
            if not (group.is_guess or refused):
                why = group.why
                refused = [one.refusal for one in tries if one.refusal is not None]
        return Unknown(max(refused, key=lambda one: one.bit, default=None), why)

    def _port_of_others(self, decoded: Sequence[Try], port: int | None) -> str:
        """Return a remark if the standard assigns the port to another type; else empty."""
        if port is None or any(one.message.btp_port == port for one in decoded):
            return ""
        carried = sorted({message.type for message in self._known if message.btp_port == port})
        return f"BTP port {port} is that of {' or '.join(carried)}" if carried else ""

    def _groups(self, octets: bytes, port: int | None) -> Iterator[Group]:
        """Yield candidate messages, the likeliest first. No message appears twice."""
        if self._is_asked:
            yield self._asked(octets)
            return
        number = octets[1] if len(octets) > 1 else -1
        announced = [message for message in self._known if number in message.ids]
        if number == LEGACY_VAM and not announced:
            announced = [message for message in self._known if VAM in message.ids]
            yield _by_version(
                Group(f"messageID {number} is that of VAM in the profile legacy, so VAM was tried", announced), octets
            )
        elif announced:
            yield _by_version(Group(f"messageID {number}", announced, is_announced=True), octets)
        by_port = [one for one in self._known if one.btp_port == port and one not in announced]
        if by_port:
            why = f"BTP port {port} carries it, though messageID is {number}"
            yield Group(why, _ranked(by_port, octets), is_guess=bool(announced), doubt=why)
        if any(octets[0] in message.versions for message in announced):
            return  # the ITS PDU header is complete and known: do not guess
        nameless = [message for message in self._known if not message.ids]
        yield Group("a guess: its octets are not an ITS PDU header", _ranked(nameless, octets), is_guess=True)
        if not announced and not by_port and len(octets) >= ITS_HEADER:
            others = [message for message in self._known if message.ids]
            why = f"a guess: no message has messageID {number}"
            yield Group(why, _ranked(others, octets), is_guess=True, doubt=why)

    def _asked(self, octets: bytes) -> Group:
        """Return the messages of --edition; if the header announces some of them, only these."""
        why = "it was asked for"
        if self._is_forced:
            return Group(why, _ranked(self._known, octets))
        announced = of_header(self._known, octets)
        if announced or len(octets) < 2 or any(not message.ids for message in self._known):
            return Group(why, _ranked(announced or self._known, octets))
        doubt = f"no edition has messageID {octets[1]} and protocolVersion {octets[0]}"
        return Group(why, _ranked(self._known, octets), doubt=doubt)


def _of_others(owners: Sequence[Message], asked: Sequence[Message], octets: bytes) -> Unknown:
    """Return the result for octets whose header belongs to other editions than --edition."""
    strict = [one for one in owners if not one.form_of]
    owned = names(sorted(strict, key=lambda one: (one.type, one.rank)))
    header = f"header: messageID {octets[1]} and protocolVersion {octets[0]}"
    why = f"{header} are those of {owned}, but --edition is {asked[0].name if len(asked) == 1 else asked[0].type}"
    return Unknown(None, why, f"omit --edition, name {owned.replace(' and ', ' or ')}, or add --force")


def _by_version(group: Group, octets: bytes) -> Group:
    """Return the group's editions with the header's protocolVersion. If none has it, return all, with a doubt."""
    version = octets[0] if octets else -1
    fits = [message for message in group.messages if version in message.versions]
    if fits:
        return group._replace(messages=_ranked(fits, octets))
    types = " or ".join(sorted({message.type for message in group.messages}))
    doubt = f"no edition of {types} has protocolVersion {version}"
    return group._replace(messages=_ranked(group.messages, octets), doubt=doubt)


def _ranked(messages: Sequence[Message], octets: bytes) -> list[Message]:
    version = octets[0] if octets else -1
    return sorted(messages, key=lambda message: (version not in message.versions, message.rank, message.name))


def _tries(group: Group, octets: bytes, is_quick: bool) -> list[Try]:
    """Return trials in order of preference. A quick search ends at the first exact one that decodes everything."""
    tries: list[Try] = []
    kind = ""
    for message in group.messages:
        one = attempt(message, octets)
        tries.append(one)
        if is_quick and one.is_exact:
            kind = kind or message.type
            is_last = message is group.messages[-1]
            is_whole = is_last or (leaves(message, octets).unknown == 0 and _is_apart(message, group, octets))
            if message.type == kind and is_whole:
                break
    return tries


def _is_apart(message: Message, group: Group, octets: bytes) -> bool:
    """Return whether the other form of the message cannot be preferred to it."""
    return not any(are_forms(message, other) for other in group.messages) or is_valid(message, octets)


def _is_sound(one: Try, octets: bytes) -> bool:
    return one.is_exact and is_valid(one.message, octets)


def _identity(group: Group, tries: Sequence[Try], decoded: Sequence[Try], octets: bytes, remark: str) -> Identity:
    exact = [one.message for one in decoded if one.is_exact]
    fits, others = compared(exact or [one.message for one in decoded], octets)
    message = fits[0]
    reasons = [_announcement(message, group.why, octets[0]) if group.is_announced else group.why]
    for one in () if group.is_guess else tries:
        if one.message is message:
            break
        if one.message not in fits and not (one.is_exact and are_forms(one.message, message)):
            reasons.append(_passed_over(one))
        elif one.message in fits[1:] and one.message not in others:
            reasons.append(f"{one.message.name} leaves some extensions undecoded")
    if not exact:
        reasons.append("encoding the decoded message again gives other octets")
    else:
        same = ", ".join(other.name for other in fits[1:])
        reasons.append("it gives the same octets back" + (f", as do {same}" if same else ""))
    if other := _told_of_forms(message, tries):
        reasons.append(other)
    if remark:
        reasons.append(remark)
    told = [f"{names(others)} also decode{'s' * (len(others) == 1)} it, to different values"] if others else []
    doubt = "; ".join([group.doubt, *told] if group.doubt else told)
    return Identity(message, "; ".join(reasons), bool(exact), tuple(fits) if exact else (), others, doubt)


def _told_of_forms(message: Message, tries: Sequence[Try]) -> str:
    """Return a reason if a less preferred form of the message does not decode; else empty."""
    behind = tries[[one.message for one in tries].index(message) + 1 :]
    for other in (one.message for one in behind if one.refusal is not None and are_forms(one.message, message)):
        return f"the form {other.name} ({'with' if other.form_of else 'without'} extension bit) does not decode"
    return ""


def _announcement(message: Message, number: str, version: int) -> str:
    if version in message.versions:
        return f"{number} and protocolVersion {version} announce it"
    return f"{number} announces it, but protocolVersion {version} is not that of this edition"


def _passed_over(one: Try) -> str:
    """Return why a preferred edition was not chosen."""
    if one.refusal is not None:
        return f"{one.message.name} does not decode ({one.refusal})"
    return f"{one.message.name} gives other octets back"
