"""Presence of ROS fields on reading.

A presence flag may come after its field, or be missing. Pointers and open types need memory first.
"""

from dataclasses import dataclass, field

from asn1.backends.c.names import literal, member, value_type
from asn1.backends.ros2.cdr.places import Place, Step, dot, follow
from asn1.backends.ros2.cdr.reading import Reading
from asn1.backends.ros2.cdr.write import Guess
from asn1.backends.ros2.model import Path, Role, RosField
from asn1.layout.nodes import Kind, Node


@dataclass
class Presence:
    """State while one message is read: the presence of the optional components that its fields lead through.

    to       function that reads it
    fields   fields of the message
    names    prefix of a field's name in paths
    flags    paths of components that have a presence flag
    guesses  optional components without a flag
    told     paths whose presence is already stored in the struct
    entered  paths of structs that are already allocated and initialised
    opens    steps into open types
    looks    by index of a field: variable with the offset after it, if a look-ahead ended there
    """

    to: Reading
    fields: tuple[RosField, ...]
    node: Node
    place: str
    names: str
    flags: frozenset[Path]
    guesses: list[Guess]
    told: set[Path] = field(default_factory=set)
    entered: set[Path] = field(default_factory=set)
    opens: dict[Path, Step] = field(default_factory=dict)
    looks: dict[int, str] = field(default_factory=dict)

    def follow(self, path: Path) -> Place:
        return follow(self.node, self.place, path, self.flags)

    def name(self, one: RosField) -> str:
        return f"{self.names}.{one.name}" if self.names else one.name

    def flag(self, index: int, one: RosField) -> None:
        """Write code that reads a presence flag; a flag that was read by a look-ahead is only skipped."""
        if one.source in self.told:
            self.to.put("at++;")
            return
        end = self.follow(one.source)
        for step in end.steps[:-1]:
            self.enter(index, step, self.follow(step.path))
        outer = " && ".join(step.condition for step in end.steps[:-1] if step.condition)
        step = end.steps[-1]
        self.to.fail_if("CAPTAIN_UNLIKELY(at >= r->size)", f'captain_cdr_cut(r, at, "{self.name(one)}")')
        if not outer:
            self.to.bool_at("at", step.condition, self.name(one))
        else:
            with self.to.block(f"if ({outer})"):
                self.to.bool_at("at", step.condition, self.name(one))
        self.to.put("at++;")
        self.told.add(one.source)

    def enter(self, index: int, step: Step, place: Place) -> None:
        """Write code that determines whether a step's target is present, then allocates and initialises it."""
        outer = " && ".join(one.condition for one in place.steps[:-1] if one.condition)
        if step.node.kind is Kind.SEQUENCE and step.condition and step.path not in self.told:
            if step.path in self.flags:
                self.look_ahead(index, step, outer)
            else:
                self.guess(next(one for one in self.guesses if one.place.steps[-1].path == step.path), outer)
        if step.path in self.entered:
            return
        self.entered.add(step.path)
        if step.child.kind is Kind.OPEN:
            self.open(step, place)
        elif step.node.kind is Kind.OPEN:
            self.row(step, place)
        elif step.field.is_pointer:
            self.pointed(step, place)
        is_message = any(one.source == step.path and one.role is Role.VALUE for one in self.fields)
        if step.child.kind is Kind.SEQUENCE and not is_message:
            if place.condition:
                with self.to.block(f"if ({place.condition})"):
                    self.begin(step.child, step.place, step.path)
            else:
                self.begin(step.child, step.place, step.path)

    def look_ahead(self, index: int, step: Step, outer: str) -> None:
        end = next(k for k, one in enumerate(self.fields) if one.role is Role.PRESENT and one.source == step.path)
        name, look = self.name(self.fields[end]), self.to.name("look")
        self.to.put(f"size_t {look} = at;")
        with self.to.block(f"if ({outer})" if outer else ""):
            for one in self.fields[index:end]:
                self.to.skip(one, self.name(one), look)
            self.to.fail_if(f"CAPTAIN_UNLIKELY({look} >= r->size)", f'captain_cdr_cut(r, {look}, "{name}")')
            self.to.bool_at(look, step.condition, name)
        self.told.add(step.path)
        if end == index + 1 and not outer:
            self.looks[index] = look

    def guess(self, guess: Guess, outer: str) -> None:
        """Write code for a component without a flag.

        It is present if it contains anything but zeros, or if another member of its addition is present.
        """
        there, look = self.to.name("there"), self.to.name("look")
        first, last = guess.fields[0], self.last_of_addition(guess)
        with self.to.block(f"if ({outer})" if outer else ""):
            self.to.put(f"bool {there} = {self.earlier(guess)};", f"size_t {look} = at;")
            for index in range(first, last + 1):
                one = self.fields[index]
                if one.role is Role.PRESENT or any(index in other.fields for other in self.guesses):
                    part = self.to.part(one, self.name(one))
                    self.to.put(f"{there} |= !captain_cdr_is_none_part(r->octets, r->size, {look}, &{part});")
                if index < last:
                    self.to.skip(one, self.name(one), look)
            self.to.put(f"{guess.place.steps[-1].condition} = {there};")
        self.told.add(guess.place.steps[-1].path)

    def earlier(self, guess: Guess) -> str:
        """Return the C condition that an earlier member of the same addition is present."""
        step = guess.place.steps[-1]
        there = []
        for f in step.node.fields:
            path = (*step.path[:-1], f.name)
            if f.addition == step.field.addition and f.in_group and path in self.told:
                there.append(f"{dot(step.holder)}has_{member(f.name)}")
        return " || ".join(there) or "false"

    def last_of_addition(self, guess: Guess) -> int:
        """Return the index of the last field of the component's extension addition, or of the component itself."""
        step = guess.place.steps[-1]
        last = guess.fields[-1]
        if not step.field.in_group:
            return last
        names = {f.name for f in step.node.fields if f.addition == step.field.addition}
        depth = len(step.path)
        for index, one in enumerate(self.fields):
            if (
                len(one.source) >= depth
                and one.source[: depth - 1] == step.path[:-1]
                and one.source[depth - 1] in names
            ):
                last = max(last, index)
        return last

    # ------------------------------------------------------------ memory, and initial values

    def begin(self, node: Node, place: str, path: Path) -> None:
        """Write code that initialises a SEQUENCE: no unknown additions, and defaults for components without a field."""
        if node.kind is not Kind.SEQUENCE:
            return
        if node.is_extensible:
            self.to.put(f"{dot(place)}additions = NULL;")
        elif not node.fields:
            self.to.put(f"{dot(place)}empty = false;")
        sources = [one.source for one in self.fields if one.role is not Role.HEADER]
        for f in node.fields:
            inside = (*path, f.name)
            if any(source[: len(inside)] == inside for source in sources):
                continue
            if f.is_optional:
                self.to.put(f"{dot(place)}has_{member(f.name)} = false;")
            elif f.node.kind is Kind.NULL:
                self.to.put(f"{dot(place)}{member(f.name)} = false;")
            else:
                self.to.put(f"captain_init(&{f.node.c_name}_type, &{dot(place)}{member(f.name)});")

    def pointed(self, step: Step, place: Place) -> None:
        kind, target = step.child.struct_name, f"{step.place[2:-1]}"
        self.to.functions.takes.append((step.child, self.least(step)))
        with self.to.block(f"if ({place.condition})" if place.condition else ""):
            made = self.to.name("made")
            self.to.put(f"{kind} *{made} = captain_cdr_take(r, 1, sizeof *{made});", f"if ({made} == NULL)")
            self.to.fail('captain_cdr_no_memory(r, at, "")')
            self.to.put(f"{target} = {made};")

    def least(self, step: Step) -> int:
        """Return the fewest octets of a struct behind a pointer."""
        found = [one for one in self.fields if one.source == step.path and one.role is Role.VALUE]
        return max(1, self.to.shapes.least(found[0])) if found else 1

    # ------------------------------------------------------------ open types

    def open(self, step: Step, place: Place) -> None:
        self.opens[step.path] = step
        with self.to.block(f"if ({place.condition})" if place.condition else ""):
            self.to.put(f"{step.place} = (captain_open){{.type = NULL}};")

    def row(self, step: Step, place: Place) -> None:
        holder = place.steps[-2]
        number, row = step.node.rows[step.number]
        outer = [one.condition for one in place.steps[:-1] if one.condition]
        self.to.functions.takes.append((row, self.least(step)))
        with self.to.block(f"if ({' && '.join([*outer, f'{_selector(holder)} == {literal(number)}'])})"):
            self.to.put(f"{dot(step.holder)}value = captain_cdr_take(r, 1, sizeof({value_type(row)}));")
            self.to.fail_if(f"{dot(step.holder)}value == NULL", 'captain_cdr_no_memory(r, at, "")')
            self.to.put(f"{dot(step.holder)}type = &{row.c_name}_type;")

    def close(self, step: Step) -> None:
        """Write code for an open type whose identifier matches no field of the message.

        Reading fails, unless unknown values are accepted.
        """
        end = self.follow(step.path)
        first = next(one for one in self.fields if one.source[: len(step.path)] == step.path)
        selector = step.node.fields[step.child.selector].name
        conditions = [*(one.condition for one in end.steps if one.condition), f"{dot(step.place)}type == NULL"]
        with self.to.block(f"if ({' && '.join(conditions)})"):
            self.to.put("if (!r->takes_unknown)")
            self.to.fail(f'captain_cdr_bad_row(r, at, (int64_t){_selector(step)}, "{selector}", "{self.name(first)}")')
            self.to.put(f'{dot(step.place)}octets = (captain_octets){{1, (const uint8_t *)""}};')


def _selector(step: Step) -> str:
    """Return the C expression of an open type's identifier. step: into the component with the open type."""
    return f"{dot(step.holder)}{member(step.node.fields[step.child.selector].name)}"
