"""Table of errors of other codecs, with the clause that decides.

Clauses of X.680 and X.691 are those of 02/2021. A difference is explained if the value holds a construct of a row for
that codec. If the row is `healed`, the codec must also agree once the constraint is written in its effective form
(effective.py). So no other error hides behind it.
"""

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

from asn1.model import types as t
from tests.asn1.bits import K16, Bits
from tests.asn1.ranges import SIZES, numbers, sizes, unfold
from tests.asn1.reach import Key, components, key_of
from tests.asn1.reference import Encoder, is_sent


class Disagreement(NamedTuple):
    construct: str
    codecs: tuple[str, ...]
    clause: str
    who_is_wrong: str
    is_healed: bool = False


TABLE = (
    Disagreement(
        "union of ranges", ("asn1tools",), "X.691 3.7.8, 10.3.21, 13.2",
        "the effective range of (0..2 | 5) is 0..5; asn1tools takes the first range alone", True,
    ),
    Disagreement(
        "SIZE on a reference", ("asn1tools",), "X.680 49.1, X.691 20.5",
        "Path (SIZE (3..16)) bounds the list; asn1tools keeps the bounds of Path", True,
    ),
    Disagreement(
        "serial constraint without marker", ("asn1tools", "pycrate"), "X.680 50.11, X.691 10.3.20",
        "the last constraint has no marker, so the type has none; asn1tools and pycrate keep the parent's", True,
    ),
    Disagreement(
        "BOOLEAN default on a reference", ("asn1tools",), "X.680 25.9, X.691 19.5",
        "a DEFAULT on a reference to BOOLEAN: asn1tools keeps its text, and sends what equals it", True,
    ),
    Disagreement(
        "absent mandatory addition", ("asn1tools",), "X.691 19.8, 19.9",
        "an older edition lacks an addition and a later one is there; asn1tools drops the later ones",
    ),
    Disagreement(
        "empty open type", ("asn1tools",), "X.691 11.1.3, 11.2.1",
        "an open type holds at least one octet; asn1tools writes a length of 0 for NULL and for what has no bits",
    ),
    Disagreement(
        "size outside of the root", ("asn1tools",), "X.691 16.6, 30.5.6",
        "SIZE (1..8, ...) of a BIT STRING or of characters lets 9 through; asn1tools refuses",
    ),
    Disagreement(
        "semi-constrained INTEGER", ("asn1tools",), "X.691 11.7, 13.2.3",
        "(0..MAX) is sent as what exceeds 0, without sign; asn1tools sends two's complement",
    ),
    Disagreement(
        "open type of 16384 octets and more", ("asn1tools",), "X.691 11.9.3.8",
        "it is sent in fragments; asn1tools does not put it together again",
    ),
    Disagreement(
        "INTEGER beyond 32 bits", ("tshark",), "X.691 11.8, 13.2.6",
        "what no bounds hold has a length of its own; tshark reads at most four octets",
    ),
    Disagreement(
        "SIZE of a UTF8String", ("tshark",), "X.691 10.3.6, 30.6",
        "its characters have no fixed width, so that PER sees no size; tshark takes it for that of the octets",
    ),
    Disagreement(
        "category of a GddStructure", ("tshark",), "X.691 23.5",
        "the CHOICE of module GDD has a marker, and so a bit for it; Wireshark 4.0 and 4.4 know it without one",
    ),
    Disagreement(
        "polygon of a PolygonalShape", ("tshark 4.4",), "X.680 49.1, X.691 20.5",
        "SIZE (3..16, ...) on a list of 1..16, ...: its number is counted from 3; Wireshark 4.4 counts from 1",
    ),
    Disagreement(
        "maxVehicleHeight of module AddGrpC", ("tshark 4.4",), "X.680 13, X.691 11.5.6",
        "AddGrpC takes VehicleHeight from DSRC, 0..127; Wireshark 4.4 from the ITS data dictionary, 1..128",
    ),
    Disagreement(
        "identifier of no row", ("tshark",), "X.681 14.2, X.682 10.16",
        "nobody: the modules leave these open types open, tshark takes some of them apart",
    ),
    Disagreement(
        "DELETE in an IA5String", ("pycrate",), "X.680 41.2, table 8",
        "IA5String has the 128 characters of ISO 646; pycrate refuses the last",
    ),
    Disagreement(
        "group of three with a mandatory one", ("pycrate",), "X.680 25.4, X.691 19.9",
        "a mandatory member of an addition group beside two others; pycrate forgets that it is there",
    ),
    Disagreement(
        "type within itself", ("pycrate",), "X.680 25.1, X.691 20.6",
        "a list whose elements hold lists of the same type; pycrate loses the outer one over the inner",
    ),
    Disagreement(
        "bits or UTF-8 in fragments", ("pycrate",), "X.691 11.9.3.8, 16.8, 30.6",
        "16384 and more are sent in fragments; pycrate does not put them together again",
    ),
)  # fmt: skip


# Components of types of the standards, which no rule about their syntax tells from others.
NAMED = {
    "GddStructure": ("category", "category of a GddStructure"),
    "PolygonalShape": ("polygon", "polygon of a PolygonalShape"),
    "LaneAttributes-addGrpC": ("maxVehicleHeight", "maxVehicleHeight of module AddGrpC"),
}


def explained(codec: str, constructs: set[str], is_healed: bool) -> list[str]:
    """The rows that explain a difference of a codec on a value with these constructs.

    codec  as asn1tools or tshark 4.4: a row of tshark is about all its versions.
    """
    names = (codec, codec.partition(" ")[0])
    rows = (one for one in TABLE if one.construct in constructs and set(names) & set(one.codecs))
    return [one.construct for one in rows if one.is_healed == is_healed]


class Constructs:
    """Finds constructs of TABLE in values."""

    def __init__(self, schema: t.Schema) -> None:
        self._schema = schema
        self._encoder = Encoder(schema)
        self._around: list[Key] = []

    def of(self, type_: t.Type, value: Any) -> set[str]:
        found: set[str] = set()
        self._around.clear()
        self._walk(type_, value, found.add)
        return found

    def _walk(self, type_: t.Type, value: Any, add: Callable[[str], None]) -> None:
        if not isinstance(type_, t.Reference):
            self._look(type_, value, add)
            return
        if key_of(type_) in self._around:
            add("type within itself")
        named, construct = NAMED.get(type_.name, ("", ""))
        if named and named in value:
            add(construct)
        self._around.append(key_of(type_))
        self._look(type_, value, add)
        self._around.pop()

    def _look(self, type_: t.Type, value: Any, add: Callable[[str], None]) -> None:
        base, constraints = unfold(self._schema, type_)
        if _is_serial(constraints, isinstance(base, t.SequenceOf)):
            add("serial constraint without marker")
        match base:
            case t.Integer():
                allowed = numbers(constraints)
                has_length = not allowed.holds(value) or allowed.low is None or allowed.high is None
                if has_length and not -(1 << 31) <= value < 1 << 31:
                    add("INTEGER beyond 32 bits")
                if allowed.has_gaps:
                    add("union of ranges")
                if allowed.low is not None and allowed.high is None:
                    add("semi-constrained INTEGER")
            case t.BitString() | t.OctetString() | t.CharacterString():
                for construct in _of_string(base, value, constraints):
                    add(construct)
            case t.SequenceOf():
                if isinstance(type_, t.Reference) and sizes(type_.constraints).root != SIZES:
                    add("SIZE on a reference")
                for one in value:
                    self._walk(base.element, one, add)
            case t.Choice():
                self._choice(base, value, add)
            case t.Sequence():
                self._sequence(base, value, add)

    def _choice(self, type_: t.Choice, value: tuple[str, Any], add: Callable[[str], None]) -> None:
        component = next((one for one in components(type_) if one.name == value[0]), None)
        if component is None:
            return
        if component not in type_.root:
            self._open(component.type, value[1], add)
        self._walk(component.type, value[1], add)

    def _sequence(self, type_: t.Sequence, value: dict[str, Any], add: Callable[[str], None]) -> None:
        self._additions(type_, value, add)
        for one in components(type_):
            if isinstance(one.default, bool) and isinstance(one.type, t.Reference):
                add("BOOLEAN default on a reference")
            if one.name not in value:
                continue
            inner: t.Type | None = one.type
            if isinstance(one.type, t.OpenType):
                rows = self._schema.modules[one.type.set_.module].sets[one.type.set_.name].rows
                inner = next((row.type for row in rows if row.value == value[one.type.selector]), None)
                if inner is None:
                    add("identifier of no row")
                else:
                    self._open(inner, value[one.name], add)
            if inner is not None:
                self._walk(inner, value[one.name], add)

    def _additions(self, type_: t.Sequence, value: dict[str, Any], add: Callable[[str], None]) -> None:
        is_missing = False
        for addition in type_.additions:
            members = addition.components if isinstance(addition, t.Group) else (addition,)
            sent = [one for one in members if is_sent(one, value)]
            if not sent:
                is_missing = is_missing or any(not one.is_optional and one.default is None for one in members)
                continue
            if is_missing:
                add("absent mandatory addition")
            if isinstance(addition, t.Group):
                if len(sent) > 2 and any(not one.is_optional for one in sent):
                    add("group of three with a mandatory one")
            elif not isinstance(addition.type, t.OpenType):
                self._open(addition.type, value[addition.name], add)

    def _open(self, type_: t.Type, value: Any, add: Callable[[str], None]) -> None:
        if isinstance(value, bytes) and not isinstance(unfold(self._schema, type_)[0], t.OctetString):
            return
        bits = Bits()
        self._encoder.encoder(type_)(bits, value)
        if not bits.count:
            add("empty open type")
        if bits.count > 8 * (K16 - 1):
            add("open type of 16384 octets and more")


def _is_serial(constraints: tuple[t.Constraint, ...], is_list: bool) -> bool:
    """A marker that a later constraint takes away."""
    before = numbers(constraints[:-1]) if not is_list else sizes(constraints[:-1])
    after = numbers(constraints) if not is_list else sizes(constraints)
    return before.is_extensible and not after.is_extensible


def _of_string(type_: t.Type, value: Any, constraints: tuple[t.Constraint, ...]) -> Iterator[str]:
    kind = type_.kind if isinstance(type_, t.CharacterString) else type(type_).__name__
    count = value[1] if kind == "BitString" else len(value)
    if kind not in ("OctetString", "UTF8String") and not sizes(constraints).holds(count):
        yield "size outside of the root"
    if kind == "UTF8String" and constraints:
        yield "SIZE of a UTF8String"
    if kind == "IA5String" and "\x7f" in value:
        yield "DELETE in an IA5String"
    if kind in ("BitString", "UTF8String") and (len(value.encode()) if kind == "UTF8String" else count) >= K16:
        yield "bits or UTF-8 in fragments"
