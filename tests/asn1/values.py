"""Generator of values of a PDU, reproducible by its seed; shapes of asn1/guide/python-functions.md.

Roots and extensions, every alternative and item, boundaries of numbers and sizes, absent and present, and additions
of a newer sender. A value has a mood: how much of it is present, how large it may become, whether it is of a newer
edition. So some values are minimal and some hold nearly everything. A budget bounds recursion and long values.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

from asn1.model import types as t
from tests.asn1 import leaves
from tests.asn1.leaves import NEVER, Holder, Make, Mood
from tests.asn1.ranges import Allowed, numbers, sizes, unfold
from tests.asn1.reach import components, key_of, reached

MAX_NESTING = 3  # of a type in itself


class Member(NamedTuple):
    """A component, ready to be made; cost: how many values it takes at least."""

    name: str
    make: Make
    cost: int
    is_optional: bool
    default: t.Default


class Values:
    """An endless source.

    knows_more  with additions, alternatives and items that the schema has not
    is_long     with lengths around the fragments of X.691 11.9.3.8, once in a while
    """

    def __init__(self, schema: t.Schema, pdu: t.Type, seed: int, knows_more: bool = True, is_long: bool = True) -> None:
        self._schema = schema
        self._mood = Mood(seed)
        self._knows_more, self._is_long = knows_more, is_long
        self._named: dict[tuple[str, str], Make] = {}
        self._costs: dict[tuple[str, str], int] = {}
        self._settle_costs(pdu)
        self._omitted: list[tuple[Holder, str, t.Default]] = []
        self._make = self._maker(pdu)

    def value(self) -> Any:
        """The next one. Components that have their default may be left out: see `complete`."""
        self._mood.change(self._knows_more, self._is_long)
        self._omitted.clear()
        return self._make({})

    @property
    def has_newer(self) -> bool:
        """Whether the last one holds what only a codec that keeps unknown additions can say."""
        return self._mood.has_newer

    def complete(self) -> None:
        """Puts the defaults into what `value` gave last: then it is what decoding its octets must give."""
        for holder, name, default in self._omitted:
            holder[name] = default

    # ---------------------------------------------------------------- what a type costs

    def _settle_costs(self, pdu: t.Type) -> None:
        names = [key for key in reached(self._schema, pdu) if key[1] in self._schema.modules[key[0]].definitions]
        is_settled = False
        while not is_settled:
            before = dict(self._costs)
            for module, name in names:
                self._costs[module, name] = self._cost(self._schema.modules[module].definitions[name].type)
            is_settled = before == self._costs

    def _cost(self, type_: t.Type) -> int:
        match type_:
            case t.Reference():
                return self._costs.get(key_of(type_), NEVER)
            case t.Sequence():
                needed = (one for one in (*type_.root, *type_.tail) if not one.is_optional and one.default is None)
                return min(NEVER, 1 + sum(self._cost(one.type) for one in needed))
            case t.Choice():
                return min((self._cost(one.type) for one in components(type_)), default=1)
            case t.SequenceOf():
                low = sizes(unfold(self._schema, type_)[1]).low or 0
                return min(NEVER, 1 + (low and low * self._cost(type_.element)))
        return 1

    # ---------------------------------------------------------------- one maker a type

    def _maker(self, type_: t.Type) -> Make:
        mood = self._mood
        if isinstance(type_, t.OpenType):
            return self._open(type_)
        if isinstance(type_, t.ClassField):
            return self._class_field(type_)
        if not isinstance(type_, t.Reference) or type_.constraints:
            return self._build(*unfold(self._schema, type_))
        key = key_of(type_)
        if key not in self._named:
            depth = 0

            def later(holder: Holder) -> Any:
                """Stays in a maker only where a type recurs."""
                nonlocal depth
                depth += 1
                if depth >= MAX_NESTING:
                    mood.left = 0
                made = self._named[key](holder)
                depth -= 1
                return made

            self._named[key] = later
            self._named[key] = self._build(*unfold(self._schema, type_))
        return self._named[key]

    def _build(self, type_: t.Type, constraints: Sequence[t.Constraint]) -> Make:
        mood = self._mood
        match type_:
            case t.Boolean():
                return lambda _: mood.chance() < 0.5
            case t.Null():
                return lambda _: None
            case t.Integer():
                return leaves.integer(mood, numbers(constraints), type_.names)
            case t.Enumerated():
                return leaves.enumerated(mood, type_)
            case t.BitString():
                return leaves.bit_string(mood, sizes(constraints), bool(type_.names))
            case t.OctetString():
                return leaves.octet_string(mood, sizes(constraints))
            case t.CharacterString():
                return leaves.characters(mood, type_.kind, constraints)
            case t.ObjectIdentifier():
                return leaves.object_identifier(mood, type_.is_relative)
            case t.SequenceOf():
                return self._list(sizes(constraints), type_.element)
            case t.Choice():
                return self._choice(type_)
            case t.Sequence():
                return self._sequence(type_)
        raise TypeError(type_)

    def _list(self, allowed: Allowed, element: t.Type) -> Make:
        make = self._maker(element)
        count = leaves.counts(self._mood, allowed, max(1, self._cost(element)))
        return lambda holder: [make(holder) for _ in range(count())]

    def _choice(self, type_: t.Choice) -> Make:
        mood = self._mood
        cheapest = self._cost(type_)
        known = [(one.name, self._maker(one.type), self._cost(one.type)) for one in components(type_)]
        pick, frugal = mood.one_of(known), mood.one_of([one for one in known if one[2] == cheapest])
        additions = len(known) - len(type_.root)

        def make(holder: Holder) -> tuple[str, Any]:
            if type_.is_extensible and mood.is_newer and mood.chance() < 0.2:
                mood.has_newer = True
                return f"[{additions + mood.above()}]", mood.octets()
            name, content, cost = pick()
            if cost > mood.left:
                name, content, _ = frugal()
            return name, content(holder)

        return make

    # ---------------------------------------------------------------- SEQUENCE, and open types in it

    def _class_field(self, type_: t.ClassField) -> Make:
        """Identifiers of the rows; from a newer sender any that the identifier's type has."""
        mood = self._mood
        base, constraints = unfold(self._schema, type_)
        pick = mood.one_of([row.value for row in self._rows(type_)] or [0])
        foreign = self._build(base, constraints)
        has_rows = bool(self._rows(type_))

        def make(holder: Holder) -> int:
            is_foreign = mood.is_newer and mood.chance() < 0.2
            mood.has_newer = mood.has_newer or is_foreign
            return int(foreign(holder) if is_foreign or not has_rows else pick())

        return make

    def _open(self, type_: t.OpenType) -> Make:
        mood = self._mood
        rows = {row.value: self._maker(row.type) for row in self._rows(type_)}

        def make(holder: Holder) -> Any:
            row = rows.get(holder[type_.selector])
            return row(holder) if row else mood.octets()

        return make

    def _rows(self, type_: t.ClassField | t.OpenType) -> tuple[t.ObjectRow, ...]:
        return self._schema.modules[type_.set_.module].sets[type_.set_.name].rows

    def _sequence(self, type_: t.Sequence) -> Make:
        mood = self._mood
        root = [self._member(one) for one in (*type_.root, *type_.tail)]
        root.sort(key=lambda one: one.name in _late(type_))  # an open type after its identifier
        additions = [
            [self._member(one) for one in (group.components if isinstance(group, t.Group) else (group,))]
            for group in type_.additions
        ]

        def make(_: Holder) -> Holder:
            value: Holder = {}
            mood.left -= 1
            self._fill(value, root)
            if type_.is_extensible:
                self._extend(value, additions)
            return value

        return make

    def _member(self, component: t.Component) -> Member:
        type_ = component.type
        return Member(component.name, self._maker(type_), self._cost(type_), component.is_optional, component.default)

    def _fill(self, value: Holder, members: list[Member]) -> None:
        mood = self._mood
        chance = mood.chance
        for name, make, cost, is_optional, default in members:
            if is_optional:
                if chance() >= mood.presence or cost > mood.left:
                    continue
            elif default is not None and chance() >= mood.presence:
                self._omitted.append((value, name, default))
                continue
            value[name] = make(value)

    def _extend(self, value: Holder, additions: list[list[Member]]) -> None:
        mood = self._mood
        known = len(additions)
        count, unknown = self._newer(known) if mood.is_newer and mood.chance() < 0.3 else (known, ())
        for members in additions[:count]:
            if mood.chance() < mood.presence and sum(one.cost for one in members) <= mood.left:
                self._fill(value, members)
        for index in unknown:
            value[f"[{index}]"] = mood.octets()
        is_extended = bool(unknown) or any(one.name in value for members in additions for one in members)
        if count != known and is_extended:
            value["[]"] = count
            mood.has_newer = True

    def _newer(self, known: int) -> tuple[int, Sequence[int]]:
        """Additions that the sender knows, and which of those it sends that we do not know."""
        mood = self._mood
        if known > 1 and mood.chance() < 0.3:
            return mood.random.randint(1, known - 1), ()
        count = known + 1 + mood.above()
        unknown = {count - 1, mood.random.randint(known, count - 1)}
        return count, sorted(unknown)


def _late(type_: t.Sequence) -> set[str]:
    return {one.name for one in (*type_.root, *type_.tail) if isinstance(one.type, t.OpenType)}
