"""Causes of decoding failures: tries common mistakes and returns the likeliest."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

from drivers.message import ITS_HEADER
from drivers.wire.editions import names
from firmware import topics
from firmware.codec.foreign import damaged_message_frame, message_frame
from firmware.codec.identify import Refusal, attempt
from firmware.codec.library import Message

SPARE = 4096  # octets of zeros that are appended to a truncated message; more than any missing part
BTP_HEADER = 4  # octets, EN 302 636-5-1 clause 7.3
# first octets of a GeoNetworking packet: version 1 or 0, next header any, common or secured
GEONETWORKING = (0x10, 0x11, 0x12, 0x00, 0x01, 0x02)

_TYPES, _LEGACY = topics.Topics(), topics.Topics("legacy")


class Case(NamedTuple):
    """Octets that do not decode.

    known    all messages of the library, regardless of --edition.
    nearest  the message that decoded the most bits; None if none was tried.
    port     BTP port of the packet; None if unknown.
    """

    octets: bytes
    known: Sequence[Message]
    nearest: Refusal | None
    port: int | None


def likeliest(case: Case) -> str:
    """Return the most probable cause and the remedy, in one sentence."""
    for cause in _CAUSES:
        found = cause(case)
        if found:
            return found
    return "it was damaged on its way, or follows an edition that the library does not have (`captain decode --list`)"


def _other_standard(case: Case) -> str:
    return message_frame(case.octets) or damaged_message_frame(case.octets) or ""


def _short(case: Case) -> str:
    if len(case.octets) == ITS_HEADER and _is_announced(case, 0):
        return f"it is truncated: its {ITS_HEADER} octets are an ITS PDU header, and nothing follows"
    if len(case.octets) >= ITS_HEADER:
        return ""
    return f"it is truncated: {len(case.octets)} octets, and the ITS PDU header alone has {ITS_HEADER}"


def _packet(case: Case) -> str:
    """Detect BTP or GeoNetworking headers in front of the PDU."""
    if _is_announced(case, BTP_HEADER) and int.from_bytes(case.octets[:2]) in _TYPES.ports:
        port = int.from_bytes(case.octets[:2])
        return f"it begins with a BTP header of port {port}: leave out the first {BTP_HEADER} octets"
    if not _is_announced(case, 0) and case.octets[0] in GEONETWORKING and len(case.octets) > 40:
        return "it begins like a GeoNetworking packet, but has no whole BTP packet inside"
    return ""


def _legacy_vam(case: Case) -> str:
    if case.octets[1] != topics.LEGACY_VAM:
        return ""
    return _or_cut_off(
        case,
        f"messageID {topics.LEGACY_VAM} is the number that older boxes used for VAM; their edition may be missing in "
        "the library",
    )


def _cut_off(case: Case) -> str:
    """Detect truncation: with zeros appended, decoding reaches the end of the octets."""
    if case.nearest is None or not _is_good(case.nearest.message, case.octets + bytes(SPARE), up_to=len(case.octets)):
        return ""
    where = f" inside {case.nearest.path}" if case.nearest.path else ""
    return f"it is truncated: its {len(case.octets)} octets end{where}"


def _or_cut_off(case: Case, cause: str) -> str:
    """Return a cause that was found by numbers alone, with truncation as an alternative if that is possible too."""
    cut_off = _cut_off(case)
    return f"{cause}; or {cut_off}" if cut_off else cause


def _is_good(message: Message, octets: bytes, up_to: int) -> bool:
    """Return whether decoding succeeds for at least the first `up_to` octets."""
    refused = attempt(message, octets).refusal
    return refused is None or refused.bit >= 8 * up_to


def _trailing(case: Case) -> str:
    """Detect octets after the message: it decodes without them."""
    if case.nearest is None:
        return ""
    whole = (case.nearest.bit + 7) // 8
    for octets in (case.octets[:whole], case.octets[: whole - 1]):
        if octets and len(octets) < len(case.octets) and attempt(case.nearest.message, octets).refusal is None:
            more = len(case.octets) - len(octets)
            return f"{more} octets follow the {len(octets)} of the message: padding, a signature, or an addition"
    return ""


def _other_edition(case: Case) -> str:
    """Detect an edition that decodes the octets, but that --edition or the header's protocolVersion excludes."""
    version, number = case.octets[:2]
    fits = [one for one in case.known if number in one.ids and attempt(one, case.octets).is_exact]
    if not fits:
        return ""
    told = f"it decodes as {names(fits, 'or')}"
    if any(version in one.versions for one in fits):
        return f"it is of another edition: {told}"
    excluded = "that edition" if len(fits) == 1 else "these editions"
    see = f"`captain decode --edition {fits[0].name} --force`"
    return f"{told}, but protocolVersion {version} excludes {excluded}; to see it: {see}"


def _wrong_port(case: Case) -> str:
    if case.port is None:
        return ""
    carried = {one.type for one in case.known if one.btp_port == case.port}
    announced = {one.type for one in case.known if case.octets[1] in one.ids}
    is_legacy = _LEGACY.by_number[case.octets[1]].btp_port == case.port
    if is_legacy or not carried or not announced or carried & announced:
        return ""
    return _or_cut_off(
        case,
        f"it came by the wrong port: BTP port {case.port} is that of {_list(carried)}, "
        f"messageID {case.octets[1]} that of {_list(announced)}",
    )


def _unknown_number(case: Case) -> str:
    if any(case.octets[1] in one.ids for one in case.known):
        return ""
    name = _TYPES.by_number[case.octets[1]].name
    lacking = f"it is {name}, which the library does not have: " if name else ""
    return f"{lacking}`captain decode --list` lists all editions; --edition selects one whatever the header says"


def _other_release(case: Case) -> str:
    versions = sorted({version for one in case.known if case.octets[1] in one.ids for version in one.versions})
    if not versions or case.octets[0] in versions:
        return ""
    known = " and ".join(map(str, versions))
    return _or_cut_off(
        case,
        f"it is of another release: protocolVersion is {case.octets[0]}, and the library has this message with {known}",
    )


# The first cause that applies is reported. Causes proved by trial decoding come before those found by numbers alone.
_CAUSES: tuple[Callable[[Case], str], ...] = (
    _other_standard,
    _short,
    _other_edition,
    _packet,
    _trailing,
    _legacy_vam,
    _unknown_number,
    _wrong_port,
    _other_release,
    _cut_off,
)


def _is_announced(case: Case, at: int) -> bool:
    """Return whether a known ITS PDU header begins at an octet."""
    head = case.octets[at : at + 2]
    return len(head) == 2 and any(head[1] in one.ids and head[0] in one.versions for one in case.known)


def _list(names: set[str]) -> str:
    return " or ".join(sorted(names))
