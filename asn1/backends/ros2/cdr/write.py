"""Writers of CDR in C: generates a function per message and type."""

from collections.abc import Iterator
from typing import NamedTuple

from asn1.backends.c.defaults import differs
from asn1.backends.c.names import literal, member
from asn1.backends.ros2.cdr.lines import Functions, Lines, shape_name
from asn1.backends.ros2.cdr.numbers import first_of, limits, memory_limits, numbers_of, unknown
from asn1.backends.ros2.cdr.places import Place, Step, dot, follow, is_struct, pointer
from asn1.backends.ros2.cdr.shapes import SIZES
from asn1.backends.ros2.model import Path, Role, RosField
from asn1.layout.nodes import Kind, Node


def writer(functions: Functions, message: str, node: Node) -> list[str]:
    """Return the writing function for a message and a type."""
    body = _Writer(functions)
    body.message(message, node, "(*v)")
    head = f"static size_t {functions.of(message, node)}_write(captain_cdr_writer *w, size_t at, const void *from)"
    first = f"    const {node.struct_name} *v = from;"
    unused = [] if body.uses("v") else ["    (void)v;"]
    return [head, "{", first, *unused, *body.lines, "    return at;", "}", ""]


class Guess(NamedTuple):
    """An optional component without a presence flag in the message.

    place   the component; the last step leads to it
    fields  indexes of the fields with its contents
    others  C conditions that other members of the same extension addition are present
    """

    place: Place
    fields: list[int]
    others: list[str]


class _Writer(Lines):
    def message(self, name: str, node: Node, place: str) -> None:
        """Write code for the fields of a message in order.

        Contents of the struct without a field are reported as left out.
        """
        fields = self.shapes.fields(name)
        starts: dict[int, str] = {}
        guesses = list(unflagged(fields, node, place))
        for index, field in enumerate(fields):
            if any(index in guess.fields for guess in guesses):
                starts[index] = self.name("start")
                self.put(f"const size_t {starts[index]} = at;")
            self.field(field, node, place)
        for guess in guesses:
            self.guessed(guess, fields, starts)
        if is_struct(node):
            self.left_out(fields, node, place)

    def field(self, field: RosField, node: Node, place: str) -> None:
        if field.role is Role.HEADER:
            self.none(field)
            return
        end = follow(node, place, field.source)
        if field.role is Role.PRESENT:
            self.put(f"at = captain_cdr_put(w, at, {_is_there(end) or '1'}, 1);")
        elif not end.condition:
            self.held(field, end)
        else:
            with self.block(f"if ({end.condition})"):
                self.held(field, end)
            with self.block("else"):
                self.none(field)

    def held(self, field: RosField, end: Place) -> None:
        match field.role:
            case Role.CHOICE:
                self.choice(field, end)
            case Role.BITS_UNUSED:
                self.put(f"at = captain_cdr_put(w, at, {_unused(end)}, 1);")
            case _:
                self.value(field, end.node, end.place)

    def none(self, field: RosField) -> None:
        """Write code for an absent field: zeros."""
        sole = self.shapes.sole(field)
        if sole.is_array:
            self.put("at = captain_cdr_put(w, at, 0, 4);")
        elif sole.type in SIZES:
            self.put(f"at = captain_cdr_put(w, at, 0, {SIZES[sole.type]});")
        elif sole.type == "string":
            self.put("at = captain_cdr_put(w, captain_cdr_put(w, at, 1, 4), 0, 1);")
        else:
            self.put(f"at = captain_cdr_none(w, at, &{shape_name(sole.type)});")

    # ------------------------------------------------------------ values

    def value(self, field: RosField, node: Node, place: str) -> None:
        if field.is_array:
            self.array(field, node, place)
        elif field.type == "string":
            kind = "oid" if node.kind in (Kind.OID, Kind.RELATIVE_OID) else "text"
            self.put(f"at = captain_cdr_put_{kind}(w, at, &{node.c_name}_type, &{place});")
        elif field.type in SIZES:
            self.put(f"at = captain_cdr_put(w, at, (uint64_t){self.number(field, node, place)}, {SIZES[field.type]});")
        elif is_struct(node):
            self.put(f"at = {self.functions.of(field.type, node)}_write(w, at, {pointer(place)});")
        else:
            self.message(field.type, node, place)

    def array(self, field: RosField, node: Node, place: str) -> None:
        match node.kind:
            case Kind.OCTET_STRING if SIZES[field.type] == 8:
                self.put(f"at = captain_cdr_put_wide(w, at, {place}.octets, {place}.count);")
            case Kind.FIXED_OCTETS if SIZES[field.type] == 8:
                self.put(f"at = captain_cdr_put_wide(w, at, {place}, {node.size});")
            case Kind.OCTET_STRING:
                self.put(f"at = captain_cdr_put_octets(w, at, {place}.octets, {place}.count);")
            case Kind.FIXED_OCTETS:
                self.put(f"at = captain_cdr_put_octets(w, at, {place}, {node.size});")
            case Kind.BIT_STRING:
                self.put(f"at = captain_cdr_put_octets(w, at, {place}.octets, ({place}.count + 7) / 8);")
            case Kind.SMALL_BITS:
                self.put(f"at = captain_cdr_put_small_bits(w, at, {place}, {node.size});")
            case _:
                index = self.name("i")
                self.put(f"at = captain_cdr_put(w, at, {dot(place)}count, 4);")
                with self.block(f"for (uint32_t {index} = 0; {index} < {dot(place)}count; {index}++)"):
                    self.value(element(field), node.item, f"{dot(place)}items[{index}]")

    def number(self, field: RosField, node: Node, place: str) -> str:
        low, high = limits(field.type)
        if node.kind is Kind.ENUMERATED and node.is_extensible:
            self.put(f"int64_t {(x := self.name('x'))} = {place};")
            with self.block(f"if (CAPTAIN_UNLIKELY({x} >= CAPTAIN_UNKNOWN))"):
                self.put(f"captain_cdr_leave(w, &{node.c_name}_type, &{place});", f"{x} = {unknown(field.type)};")
            return x
        if node.kind is Kind.SMALL_BITS:
            return f"captain_cdr_turn({place}, {node.size})"
        if node.kind is Kind.BIT_STRING:
            return f"captain_cdr_bits_number(w, &{node.c_name}_type, &{place})"
        if node.kind is not Kind.INTEGER:
            return place
        least, most = memory_limits(node)
        if least >= low and most <= high:
            return place
        if node.bounds.low is not None and node.bounds.high is not None and not node.is_extensible:
            return place  # decode() and encode() accept only values of the root
        return (
            f"captain_cdr_fit(w, (int64_t){place}, {literal(low)}, {literal(min(high, (1 << 63) - 1))}, "
            f"&{node.c_name}_type, &{place})"
        )

    def choice(self, field: RosField, end: Place) -> None:
        numbers = numbers_of(field, end.node.fields)
        chosen, none, size = f"{dot(end.place)}choice", unknown(field.type), SIZES[field.type]
        first = first_of(numbers)
        x = self.name("x")
        self.put(f"int64_t {x} = {none};")
        with self.block(f"if ({chosen} - 1 < {len(numbers)})"):
            if first is not None:
                self.put(f"{x} = (int64_t){chosen} - 1{f' + {first}' if first else ''};")
            else:
                items = ", ".join(str(none if one is None else one) for one in numbers)
                self.put(f"static const int64_t numbers[] = {{{items}}};", f"{x} = numbers[{chosen} - 1];")
        with self.block(f"if (CAPTAIN_UNLIKELY({x} == {none}))"):
            self.put(f"captain_cdr_leave(w, &{end.node.c_name}_type, {pointer(end.place)});")
        self.put(f"at = captain_cdr_put(w, at, (uint64_t){x}, {size});")

    # ------------------------------------------------------------ contents without a field

    def left_out(self, fields: tuple[RosField, ...], node: Node, place: str) -> None:
        if is_alias(fields):
            return
        sources = [field.source for field in fields if field.role is not Role.HEADER]
        for lost in losses(sources, node, place, ()):
            with self.block(f"if (CAPTAIN_UNLIKELY({lost[0]}))"):
                self.put(f"captain_cdr_leave(w, {lost[1]});")

    def guessed(self, guess: Guess, fields: tuple[RosField, ...], starts: dict[int, str]) -> None:
        """Write code that reports a present component as left out if it has no flag and is all zeros.

        A reader would take it for absent.
        """
        is_none = []
        for index in guess.fields:
            part = self.part(fields[index])
            is_none.append(f"captain_cdr_is_none_part(w->octets, w->size, {starts[index]}, &{part})")
        conditions = [guess.place.condition, *(f"!({one})" for one in guess.others), *is_none]
        with self.block(f"if ({' && '.join(conditions)})"):
            step = guess.place.steps[-1]
            self.put(f"captain_cdr_leave(w, &{step.child.c_name}_type, {pointer(step.place)});")


def _is_there(end: Place) -> str:
    """Return the C condition of presence. A component with a DEFAULT is present if it differs from it."""
    step = end.steps[-1]
    conditions = [one.condition for one in end.steps if one.condition]
    if step.node.kind is Kind.SEQUENCE and step.field.default is not None:
        conditions.append(differs(step.child, step.field.default, step.place))
    return " && ".join(conditions)


def _unused(end: Place) -> str:
    if end.node.kind is Kind.SMALL_BITS:
        return str(-end.node.size % 8)
    return f"-{end.place}.count & 7"


def element(field: RosField) -> RosField:
    """Return the field of a list's element."""
    return RosField(field.type, field.name)


def unflagged(fields: tuple[RosField, ...], node: Node, place: str) -> Iterator[Guess]:
    """Yield the optional components of a message without a presence flag."""
    flags = {field.source for field in fields if field.role is Role.PRESENT}
    found: dict[Path, Guess] = {}
    for field in fields:
        if field.role is Role.HEADER:
            continue
        for step in follow(node, place, field.source).steps:
            if step.node.kind is Kind.SEQUENCE and step.condition and step.path not in flags and step.path not in found:
                inside = [k for k, one in enumerate(fields) if one.source[: len(step.path)] == step.path]
                guess = Guess(follow(node, place, step.path), inside, list(others_of(step)))
                found[step.path] = guess
                yield guess


def is_alias(fields: tuple[RosField, ...]) -> bool:
    """Return whether the message renames another type. Then the code for its one field reports what is left out."""
    return any(field.role is Role.VALUE and not field.source and not field.is_array for field in fields)


def others_of(step: Step) -> Iterator[str]:
    """Yield C conditions that other members of the same addition are present."""
    for f in step.node.fields:
        if f.addition != step.field.addition or not f.in_group or f is step.field:
            continue
        place = f"{dot(step.holder)}{member(f.name)}"
        yield f"{dot(step.holder)}has_{member(f.name)}" if f.default is None else differs(f.node, f.default, place)


def losses(sources: list[Path], node: Node, place: str, path: Path) -> Iterator[tuple[str, str]]:
    """Yield condition and arguments of captain_cdr_leave for each part of a struct without a field."""
    if node.kind is Kind.SEQUENCE and node.is_extensible:
        yield f"{dot(place)}additions != NULL", f"NULL, {dot(place)}additions"
    if node.kind is Kind.OPEN:
        there = [
            f"{dot(place)}type == &{row.c_name}_type" for k, row in node.rows if _is_held((*path, str(k)), sources)
        ]
        yield f"!({' || '.join(there) or '0'})", f"&{node.c_name}_type, {pointer(place)}"
    if node.kind not in (Kind.SEQUENCE, Kind.CHOICE):
        return
    for f in node.fields:
        step = follow(node, place, (f.name,)).steps[0]
        inside = (*path, f.name)
        if not _is_held(inside, sources):
            if node.kind is Kind.SEQUENCE and f.node.kind is not Kind.NULL:
                yield step.condition or "true", f"&{f.node.c_name}_type, {pointer(step.place)}"
        elif any(len(source) > len(inside) and source[: len(inside)] == inside for source in sources):
            for condition, arguments in losses(sources, f.node, step.place, inside):
                yield f"{step.condition} && ({condition})" if step.condition else condition, arguments


def _is_held(path: Path, sources: list[Path]) -> bool:
    return any(source[: len(path)] == path for source in sources)
