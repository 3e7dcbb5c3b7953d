"""PDUs of one edition, decoded with every other edition that accepts the header.

A value is made from the schema as a sender of the edition can write it. It is encoded with each header that announces
the edition. The station's programs and V2N payloads must show the value, or name the edition beside it. Values are
compared by numbers, items, places of set bits, strings and absent components of the root. These are the rules of the
library's own comparison (asn1/backends/c/runtime/src/leaves.c), in other code over the schema.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from asn1.model import types as t
from drivers.mqtt.profile import MessageLibrary
from firmware.codec.identify import Identifier, Identity
from tests.asn1.ranges import read_as, unfold
from tests.asn1.reach import components, pruned
from tests.asn1.values import Values

SEED = 22
EXAMPLES = 3  # of PDUs that are silently shown, an edition
COLUMNS = "{:<25}{:>8}{:>8}{:>8}{:>8}{:>8}{:>8}"
HEADS = ("message", "PDUs", "rivals", "fit too", "other", "named", "silent")


@dataclass
class Confused:
    """Of one edition: PDUs made, other editions of their headers, trials in which such an edition gave the octets back.

    other   trials in which that edition decoded to different values.
    named   PDUs whose output named an edition that decodes to different values, or was refused.
    silent  PDUs that were shown with different values and no warning.
    """

    pdus: int = 0
    rivals: int = 0
    fits: int = 0
    other: int = 0
    named: int = 0
    silent: int = 0
    examples: list[str] = field(default_factory=list)

    def add(self, more: "Confused") -> None:
        self.pdus += more.pdus
        self.rivals = max(self.rivals, more.rivals)
        self.fits += more.fits
        self.other += more.other
        self.named += more.named
        self.silent += more.silent
        self.examples = [*self.examples, *more.examples][:EXAMPLES]

    def fail(self, what: str) -> None:
        self.silent += 1
        self.examples = [*self.examples, what][:EXAMPLES]


ABSENT = object()  # an optional component of the root


class Unknown(NamedTuple):
    """A part of a message that an edition does not know."""

    value: object


class Trial:
    """messages: those of the library, as captain_messages.all() gives them."""

    def __init__(self, schema: t.Schema, messages: Sequence[Any]) -> None:
        self._schema = schema
        self._messages = {one.name: one for one in messages}
        self._identifier = Identifier(sorted(messages, key=lambda one: one.rank))
        self._payloads = MessageLibrary(messages)

    def run(self, name: str, count: int, seed: int = SEED) -> Confused:
        """PDUs of an edition that has a header."""
        message = self._schema.messages[name]
        read = read_as(pruned(self._schema, message.pdu), message)
        values = Values(read, message.pdu, seed, knows_more=False, is_long=False)
        heads = [(version, number) for version in message.versions for number in message.ids]
        found = Confused()
        for at in range(count):
            value = values.value()
            self._messages[name].encode(value)
            values.complete()
            version, number = heads[at % len(heads)]
            header = dict(zip(value["header"], (version, number, 4711), strict=True))
            self._try(name, {**value, "header": header}, found)
        return found

    def _try(self, name: str, value: Any, found: Confused) -> None:
        own = self._messages[name]
        pdu = own.encode(value)
        values = self._read(name, value)
        others = set()
        rivals = [one for one in self._messages.values() if one is not own and pdu[1] in one.ids]
        rivals = [one for one in rivals if pdu[0] in one.versions]
        for rival in rivals:
            try:
                decoded = rival.decode(pdu)
                if rival.encode(decoded) != pdu:
                    continue
            except ValueError:
                continue
            found.fits += 1
            read = self._read(rival.name, decoded)
            if read != values:
                found.other += 1
                # A sender of an edition of this type that knows fewer parts could not have written it.
                if rival.type != own.type or _unknown(read) <= _unknown(values):
                    others.add(rival.name)
        found.pdus += 1
        found.rivals = max(found.rivals, len(rivals))
        told = self._shown(name, pdu, values, others)
        found.named += told == "named"
        if told not in ("", "named"):
            found.fail(f"{name}: {told}: {pdu.hex()}")

    def _shown(self, name: str, pdu: bytes, values: list[object], others: set[str]) -> str:
        """Empty: with these values; "named": with a word of the others; else what is silently wrong."""
        shown = self._identifier.identify(pdu)
        if not isinstance(shown, Identity):
            return f"it is refused: {shown.why}"
        told = {shown.message.name, *(one.name for one in shown.others)}
        if self._read(shown.message.name, shown.message.decode(pdu)) != values and name not in told:
            return f"shown as {shown.message.name}"
        if others and not {name, *others} <= told:
            return f"shown as {shown.message.name} without a word of {', '.join(sorted({name, *others} - told))}"
        try:
            edition, value = next(iter(self._payloads.decodings(pdu)))
        except ValueError:
            return "named" if others else "no payload of V2N holds it"
        if self._read(edition.name, value) != values:
            return f"a payload of V2N holds it as {edition.name}"
        return "named" if others else ""

    def _read(self, name: str, value: Any) -> list[object]:
        return list(_walk(self._schema, self._schema.messages[name].pdu, value))


def report(found: dict[str, Confused]) -> Iterator[str]:
    """The table, and examples of what is silent."""
    yield "PDUs of each edition, tried with every other edition that their header announces as well (rivals)."
    yield "other: trials that decode to different values; named: PDUs whose output warns; silent: goal 0."
    yield COLUMNS.format(*HEADS)
    total = Confused()
    for name, one in found.items():
        yield COLUMNS.format(name, one.pdus, one.rivals, one.fits, one.other, one.named, one.silent)
        total.add(one)
    yield COLUMNS.format("all", total.pdus, "", total.fits, total.other, total.named, total.silent)
    verdict = "reached" if not total.silent else "MISSED"
    yield f"silently shown as another edition's with other values: {total.silent} (goal: 0) {verdict}"
    for one in found.values():
        yield from (f"\nsilent: {example}" for example in one.examples)


def _walk(schema: t.Schema, type_: t.Type, value: Any) -> Iterator[object]:
    base, _ = unfold(schema, type_)
    match base:
        case t.Sequence():
            yield from _members(schema, base, value)
        case t.Choice():
            names = [one.name for one in components(base)]
            if value[0] not in names:
                yield Unknown(value)
                return
            yield names.index(value[0])
            yield from _walk(schema, list(components(base))[names.index(value[0])].type, value[1])
        case t.SequenceOf():
            yield len(value)
            for one in value:
                yield from _walk(schema, base.element, one)
        case t.Enumerated():
            names = [one.name for one in (*base.root, *base.additions)]
            yield names.index(value) if isinstance(value, str) else Unknown(value)
        case t.BitString():
            octets, size = value
            yield tuple(at for at in range(size) if octets[at // 8] >> (7 - at % 8) & 1)
        case t.Boolean():
            yield int(value)
        case _:
            yield value


def _members(schema: t.Schema, type_: t.Sequence, value: dict[str, Any]) -> Iterator[object]:
    known, root = list(components(type_)), (*type_.root, *type_.tail)
    for one in known:
        if one.name not in value:
            if one in root:
                yield ABSENT
            continue
        if not isinstance(one.type, t.OpenType):
            yield from _walk(schema, one.type, value[one.name])
        elif isinstance(value[one.name], bytes):
            yield Unknown(value[one.name])
        else:
            rows = schema.modules[one.type.set_.module].sets[one.type.set_.name].rows
            row = next(row.type for row in rows if row.value == value[one.type.selector])
            yield from _walk(schema, row, value[one.name])
    names = {one.name for one in known}
    for name, part in value.items():
        if name not in names and name != "[]":
            yield Unknown(part)


def _unknown(read: list[object]) -> int:
    return sum(isinstance(one, Unknown) for one in read)
