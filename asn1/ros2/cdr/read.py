"""Model and layout to C: a function per message and type that reads CDR into a struct.

What is absent is passed over and not looked at. Whether it is there says a flag that may stand behind the field: then
the flag is looked at first, and the field is read, or not, after that.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from asn1.c.defaults import default_lines, differs
from asn1.c.names import contiguous, literal, member, value_type
from asn1.nodes import Kind, Node
from asn1.ros2.cdr.lines import Functions, Lines, shape_name
from asn1.ros2.cdr.numbers import first_of, limits, memory_limits, numbers_of, outside, unknown
from asn1.ros2.cdr.places import Place, Step, dot, follow, is_struct, pointer
from asn1.ros2.cdr.shapes import SIZES
from asn1.ros2.cdr.write import Guess, element, is_alias, unflagged
from asn1.ros2.model import Path, Role, RosField


def reader(functions: Functions, message: str, node: Node) -> list[str]:
    """The function of a pair."""
    body = _Reader(functions)
    body.message(message, node, "(*v)", "")
    body.finish(node)
    head = f"static size_t {functions.of(message, node)}_read(captain_cdr_reader *r, size_t at, void *to)"
    first = [f"    {node.c_name} *v = to;", *(f"    uint32_t {index} = 0;" for index in body.indexes)]
    unused = [f"    (void){word};" for word in ("v", "r") if not body.uses(word)]
    return [head, "{", *first, *unused, *body.lines, "    return at;", *body.exits, "}", ""]


@dataclass
class _Message:
    """One message on its way: what is known of the optional components that its fields lead through.

    fields   of it
    names    what stands before the name of a field in a path
    flags    sources of those that say whether something is there
    guesses  what may be absent, and none of them says
    told     paths whose presence has been put into the struct
    entered  paths of structs that have their memory, and what no field says
    opens    steps into open types
    looks    by the index of a field: where a look ahead from it has ended, if that was behind this very field
    """

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


class _Reader(Lines):
    def __init__(self, functions: Functions) -> None:
        super().__init__(functions)
        self.indexes: list[str] = []
        self.exits: list[str] = []
        self.ways_out: list[str] = []  # of the lists around: labels

    def message(self, name: str, node: Node, place: str, names: str) -> None:
        fields = self.shapes.fields(name)
        flags = frozenset(one.source for one in fields if one.role is Role.PRESENT)
        of = _Message(fields, node, place, names, flags, list(unflagged(fields, node, place)))
        if is_struct(node) and not is_alias(fields):
            self.begin(of, node, place, ())
        if node.recurs:
            with self.block("if (++r->depth > CAPTAIN_MAX_RECURSION)"):
                self.fail("captain_cdr_too_deep(r, at)")
        for index, one in enumerate(fields):
            self.field(of, index, one)
        for step in of.opens.values():
            self.close(of, step)

    def finish(self, node: Node) -> None:
        if node.recurs:
            self.put("r->depth--;")

    # ------------------------------------------------------------ failing

    def fail(self, call: str) -> None:
        """Leave the function; inside a list the way out puts the index of the element in front."""
        if self.ways_out:
            with self.block():
                self.put(f"{call};", f"goto {self.ways_out[-1]};")
        else:
            self.put(f"    return {call};")

    def fail_if(self, condition: str, call: str) -> None:
        self.put(f"if ({condition})")
        self.fail(call)

    def call(self, expression: str, name: str = "") -> None:
        """What has said itself what is wrong; name: the field that the name of which is still missing."""
        self.put(f"at = {expression};", "if (CAPTAIN_UNLIKELY(at == CAPTAIN_FAILED))")
        if name:
            self.fail(f'captain_cdr_in(r, "{name}")')
        elif self.ways_out:
            self.put(f"    goto {self.ways_out[-1]};")
        else:
            self.put("    return at;")

    @contextmanager
    def item(self, index: str, name: str) -> Iterator[None]:
        """Inside an element of a list."""
        label = f"in_{index}"
        outer = f"goto {self.ways_out[-1]};" if self.ways_out else "return CAPTAIN_FAILED;"
        self.ways_out.append(label)
        before = len(self.lines)
        yield
        self.ways_out.pop()
        if any(f"goto {label};" in line for line in self.lines[before:]) or any(
            f"goto {label};" in one for one in self.exits
        ):
            self.exits += [f"{label}:", f'    captain_cdr_in_item(r, {index}, "{name}");', f"    {outer}"]

    # ------------------------------------------------------------ fields

    def field(self, of: _Message, index: int, one: RosField) -> None:
        if one.role is Role.HEADER:
            self.skip(of, one)
            return
        if one.role is Role.PRESENT:
            self.flag(of, index, one)
            return
        end = of.follow(one.source)
        for step in end.steps:
            self.enter(of, index, step, of.follow(step.path))
        if not end.condition:
            self.held(of, one, end)
            return
        with self.block(f"if ({end.condition})"):
            self.held(of, one, end)
        with self.block("else"):
            if index in of.looks:
                self.put(f"at = {of.looks[index]};")
            else:
                self.skip(of, one)
            self.absent(end)

    def absent(self, end: Place) -> None:
        """What has a DEFAULT holds it where a flag says that it is not there."""
        step = end.steps[-1]
        if step.node.kind is not Kind.SEQUENCE or step.field.default is None:
            return
        outer = " && ".join(one.condition for one in end.steps[:-1] if one.condition)
        with self.block(f"if ({outer})" if outer else ""):
            self.put(*default_lines(step.child, step.field.default, step.place))

    def held(self, of: _Message, one: RosField, end: Place) -> None:
        name = of.name(one)
        match one.role:
            case Role.CHOICE:
                self.choice(one, end, name)
            case Role.BITS_UNUSED if end.node.kind is Kind.SMALL_BITS:
                self.call(f'captain_cdr_get_small_unused(r, at, &{end.node.c_name}_type, "{name}")')
            case Role.BITS_UNUSED:
                self.call(f'captain_cdr_get_unused(r, at, &{end.place}, &{end.node.c_name}_type, "{name}")')
            case _:
                self.value(one, end.node, end.place, name)
                self.default(end)

    def default(self, end: Place) -> None:
        """Without a flag an addition is there if it differs from its DEFAULT; in the root encode sees to that."""
        f = end.steps[-1].field if end.steps and end.steps[-1].node.kind is Kind.SEQUENCE else None
        if f is not None and f.default is not None and not end.steps[-1].condition:
            flag = f"{dot(end.steps[-1].holder)}has_{member(f.name)}"
            self.put(f"{flag} = {differs(f.node, f.default, end.place) if f.addition else 'true'};")

    def skip(self, of: _Message, one: RosField, at: str = "at") -> None:
        """Over a field that nobody looks at."""
        name = of.name(one)
        if not one.is_array and one.type in SIZES:
            size = SIZES[one.type]
            self.put(f"{at} = {_behind(at, size)};")
            self.fail_if(f"CAPTAIN_UNLIKELY({at} > r->size)", f'captain_cdr_cut(r, {at} - {size}, "{name}")')
            return
        if not one.is_array and one.type != "string":
            expression = f'captain_cdr_skip(r, {at}, &{shape_name(one.type)}, "{name}")'
        else:
            expression = f"captain_cdr_walk_part(r, {at}, &{self.part(one, name)})"
        self.put(f"{at} = {expression};", f"if (CAPTAIN_UNLIKELY({at} == CAPTAIN_FAILED))")
        self.put(f"    goto {self.ways_out[-1]};" if self.ways_out else "    return CAPTAIN_FAILED;")

    # ------------------------------------------------------------ what may be absent

    def flag(self, of: _Message, index: int, one: RosField) -> None:
        """Whether something is there; looked at before, it is only passed."""
        if one.source in of.told:
            self.put("at++;")
            return
        end = of.follow(one.source)
        for step in end.steps[:-1]:
            self.enter(of, index, step, of.follow(step.path))
        outer = " && ".join(step.condition for step in end.steps[:-1] if step.condition)
        step = end.steps[-1]
        self.fail_if("CAPTAIN_UNLIKELY(at >= r->size)", f'captain_cdr_cut(r, at, "{of.name(one)}")')
        if not outer:
            self.bool_at("at", step.condition, of.name(one))
        else:
            with self.block(f"if ({outer})"):
                self.bool_at("at", step.condition, of.name(one))
        self.put("at++;")
        of.told.add(one.source)

    def bool_at(self, at: str, into: str, name: str) -> None:
        self.fail_if(f"r->octets[{at}] > 1", f'captain_cdr_bad_bool(r, {at}, "{name}")')
        self.put(f"{into} = r->octets[{at}] != 0;")

    def enter(self, of: _Message, index: int, step: Step, place: Place) -> None:
        """Find out whether the step leads to something, and if so, give that memory and what no field says of it."""
        outer = " && ".join(one.condition for one in place.steps[:-1] if one.condition)
        if step.node.kind is Kind.SEQUENCE and step.condition and step.path not in of.told:
            if step.path in of.flags:
                self.look_ahead(of, index, step, outer)
            else:
                self.guess(of, next(one for one in of.guesses if one.place.steps[-1].path == step.path), outer)
        if step.path in of.entered:
            return
        of.entered.add(step.path)
        if step.child.kind is Kind.OPEN:
            self.open(of, step, place)
        elif step.node.kind is Kind.OPEN:
            self.row(of, step, place)
        elif step.field.is_pointer:
            self.pointed(of, step, place)
        is_message = any(one.source == step.path and one.role is Role.VALUE for one in of.fields)
        if step.child.kind is Kind.SEQUENCE and not is_message:
            if place.condition:
                with self.block(f"if ({place.condition})"):
                    self.begin(of, step.child, step.place, step.path)
            else:
                self.begin(of, step.child, step.place, step.path)

    def pointed(self, of: _Message, step: Step, place: Place) -> None:
        kind, target = step.child.c_name, f"{step.place[2:-1]}"
        self.functions.takes.append((step.child, self.least(of, step)))
        with self.block(f"if ({place.condition})" if place.condition else ""):
            made = self.name("made")
            self.put(f"{kind} *{made} = captain_cdr_take(r, 1, sizeof *{made});", f"if ({made} == NULL)")
            self.fail('captain_cdr_no_memory(r, at, "")')
            self.put(f"{target} = {made};")

    def least(self, of: _Message, step: Step) -> int:
        """Octets of what lies behind a pointer: never fewer."""
        found = [one for one in of.fields if one.source == step.path and one.role is Role.VALUE]
        return max(1, self.shapes.least(found[0])) if found else 1

    def begin(self, of: _Message, node: Node, place: str, path: Path) -> None:
        """A SEQUENCE has no additions that its fields do not know, and nothing that no field is about."""
        if node.kind is not Kind.SEQUENCE:
            return
        if node.is_extensible:
            self.put(f"{dot(place)}additions = NULL;")
        elif not node.fields:
            self.put(f"{dot(place)}empty = false;")
        sources = [one.source for one in of.fields if one.role is not Role.HEADER]
        for f in node.fields:
            inside = (*path, f.name)
            if any(source[: len(inside)] == inside for source in sources):
                continue
            if f.is_optional:
                self.put(f"{dot(place)}has_{member(f.name)} = false;")
            elif f.node.kind is Kind.NULL:
                self.put(f"{dot(place)}{member(f.name)} = false;")
            else:
                self.put(f"captain_init(&{f.node.c_name}_type, &{dot(place)}{member(f.name)});")

    def look_ahead(self, of: _Message, index: int, step: Step, outer: str) -> None:
        end = next(k for k, one in enumerate(of.fields) if one.role is Role.PRESENT and one.source == step.path)
        name, look = of.name(of.fields[end]), self.name("look")
        self.put(f"size_t {look} = at;")
        with self.block(f"if ({outer})" if outer else ""):
            for one in of.fields[index:end]:
                self.skip(of, one, look)
            self.fail_if(f"CAPTAIN_UNLIKELY({look} >= r->size)", f'captain_cdr_cut(r, {look}, "{name}")')
            self.bool_at(look, step.condition, name)
        of.told.add(step.path)
        if end == index + 1 and not outer:
            of.looks[index] = look

    def guess(self, of: _Message, guess: Guess, outer: str) -> None:
        """Without a flag it is there if anything but zeros is in it, or if another member of its addition is there."""
        there, look = self.name("there"), self.name("look")
        first, last = guess.fields[0], self.last_of_addition(of, guess)
        with self.block(f"if ({outer})" if outer else ""):
            self.put(f"bool {there} = {self.earlier(of, guess)};", f"size_t {look} = at;")
            for index in range(first, last + 1):
                one = of.fields[index]
                if one.role is Role.PRESENT or any(index in other.fields for other in of.guesses):
                    part = self.part(one, of.name(one))
                    self.put(f"{there} |= !captain_cdr_is_none_part(r->octets, r->size, {look}, &{part});")
                if index < last:
                    self.skip(of, one, look)
            self.put(f"{guess.place.steps[-1].condition} = {there};")
        of.told.add(guess.place.steps[-1].path)

    def earlier(self, of: _Message, guess: Guess) -> str:
        """C: another member of its addition, whose fields stand in front, is there."""
        step = guess.place.steps[-1]
        there = []
        for f in step.node.fields:
            path = (*step.path[:-1], f.name)
            if f.addition == step.field.addition and f.in_group and path in of.told:
                there.append(f"{dot(step.holder)}has_{member(f.name)}")
        return " || ".join(there) or "false"

    def last_of_addition(self, of: _Message, guess: Guess) -> int:
        """Index of the last field of the extension addition that it is a member of, or of itself."""
        step = guess.place.steps[-1]
        last = guess.fields[-1]
        if not step.field.in_group:
            return last
        names = {f.name for f in step.node.fields if f.addition == step.field.addition}
        depth = len(step.path)
        for index, one in enumerate(of.fields):
            if (
                len(one.source) >= depth
                and one.source[: depth - 1] == step.path[:-1]
                and one.source[depth - 1] in names
            ):
                last = max(last, index)
        return last

    # ------------------------------------------------------------ open types

    def open(self, of: _Message, step: Step, place: Place) -> None:
        of.opens[step.path] = step
        with self.block(f"if ({place.condition})" if place.condition else ""):
            self.put(f"{step.place} = (captain_open){{.type = NULL}};")

    def row(self, of: _Message, step: Step, place: Place) -> None:
        holder = place.steps[-2]
        number, row = step.node.rows[step.number]
        outer = [one.condition for one in place.steps[:-1] if one.condition]
        self.functions.takes.append((row, self.least(of, step)))
        with self.block(f"if ({' && '.join([*outer, f'{_selector(holder)} == {literal(number)}'])})"):
            self.put(f"{dot(step.holder)}value = captain_cdr_take(r, 1, sizeof({value_type(row)}));")
            self.fail_if(f"{dot(step.holder)}value == NULL", 'captain_cdr_no_memory(r, at, "")')
            self.put(f"{dot(step.holder)}type = &{row.c_name}_type;")

    def close(self, of: _Message, step: Step) -> None:
        """The identifier stands for nothing that the message has a field for."""
        end = of.follow(step.path)
        first = next(one for one in of.fields if one.source[: len(step.path)] == step.path)
        selector = step.node.fields[step.child.selector].name
        conditions = [*(one.condition for one in end.steps if one.condition), f"{dot(step.place)}type == NULL"]
        with self.block(f"if ({' && '.join(conditions)})"):
            self.put("if (!r->takes_unknown)")
            self.fail(f'captain_cdr_bad_row(r, at, (int64_t){_selector(step)}, "{selector}", "{of.name(first)}")')
            self.put(f'{dot(step.place)}octets = (captain_octets){{1, (const uint8_t *)""}};')

    # ------------------------------------------------------------ values

    def value(self, one: RosField, node: Node, place: str, name: str) -> None:
        if one.is_array:
            self.array(one, node, place, name)
        elif one.type == "string":
            kind = "oid" if node.kind in (Kind.OID, Kind.RELATIVE_OID) else "text"
            self.call(f'captain_cdr_get_{kind}(r, at, &{place}, &{node.c_name}_type, "{name}")')
        elif one.type in SIZES:
            self.number(one, node, place, name)
        elif is_struct(node):
            self.call(f"{self.functions.of(one.type, node)}_read(r, at, {pointer(place)})", name)
        else:
            self.message(one.type, node, place, name)

    def array(self, one: RosField, node: Node, place: str, name: str) -> None:
        type_ = f"&{node.c_name}_type"
        match node.kind:
            case Kind.OCTET_STRING | Kind.FIXED_OCTETS if SIZES[one.type] == 8:
                self.wide(node, place, name)
            case Kind.OCTET_STRING:
                self.call(f'captain_cdr_get_string(r, at, &{place}, {type_}, "{name}")')
            case Kind.FIXED_OCTETS:
                self.call(f'captain_cdr_get_fixed(r, at, {place}, {type_}, "{name}")')
            case Kind.BIT_STRING:
                with self.block():
                    self.put("captain_octets octets;")
                    self.call(f'captain_cdr_get_octets(r, at, &octets, "{name}")')
                    self.put(f"{place} = (captain_bits){{8 * octets.count, octets.octets}};")
            case Kind.SMALL_BITS:
                with self.block():
                    self.put("uint64_t bits;")
                    self.call(f'captain_cdr_get_small_bits(r, at, &bits, {type_}, "{name}")')
                    self.put(f"{place} = ({value_type(node)})bits;")
            case Kind.LIST:
                self.list_(one, node, place, name)
            case _:
                self.single(one, node, place, name)

    def wide(self, node: Node, place: str, name: str) -> None:
        """Octets as numbers of 64 bits."""
        with self.block():
            self.put("captain_octets octets;")
            self.call(f'captain_cdr_get_wide(r, at, &octets, &{node.c_name}_type, "{name}")')
            if node.kind is Kind.OCTET_STRING:
                self.put(f"{place} = octets;")
            else:
                self.put(f"memcpy({place}, octets.octets, sizeof {place});")

    def list_(self, one: RosField, node: Node, place: str, name: str) -> None:
        index, items = self.name("i"), f"{dot(place)}items"
        self.indexes.append(index)
        self.functions.lists.append((node.item, self.shapes.least(element(one))))
        bounds = node.bounds
        wrong = [f"{dot(place)}count < {bounds.low}"] if bounds.low else []
        wrong += [f"{dot(place)}count > {bounds.high}"] if bounds.high is not None and bounds.high < 1 << 32 else []
        self.call(f'captain_cdr_get_count(r, at, {self.shapes.least(element(one))}, &{dot(place)}count, "{name}")')
        if wrong and not node.is_extensible:
            bad = f'captain_cdr_bad_count(r, at - 4, {dot(place)}count, &{node.c_name}_type, "{name}")'
            self.fail_if(" || ".join(wrong), bad)
        self.put(f"{items} = NULL;")
        with self.block(f"if ({dot(place)}count != 0)"):
            self.put(f"{items} = captain_cdr_take(r, {dot(place)}count, sizeof *{items});")
            self.fail_if(f"{items} == NULL", f'captain_cdr_no_memory(r, at, "{name}")')
        with (
            self.block(f"for ({index} = 0; {index} < {dot(place)}count; {index}++)"),
            self.item(index, name),
        ):
            self.value(element(one), node.item, f"{items}[{index}]", "")

    def single(self, one: RosField, node: Node, place: str, name: str) -> None:
        """A list of messages that go one by one."""
        with self.block():
            self.put("uint32_t count;")
            self.call(f'captain_cdr_get_count(r, at, {self.shapes.least(element(one))}, &count, "{name}")')
            self.fail_if("count != 1", f'captain_cdr_not_one(r, at - 4, count, "{name}")')
        self.value(element(one), node, place, name)

    def number(self, one: RosField, node: Node, place: str, name: str) -> None:
        size = SIZES[one.type]
        self.put(f"at = {_behind('at', size)};")
        self.fail_if("CAPTAIN_UNLIKELY(at > r->size)", f'captain_cdr_cut(r, at - {size}, "{name}")')
        if node.kind is Kind.BOOLEAN:
            self.bool_at("at - 1", place, name)
            return
        if node.kind is Kind.NULL:
            self.put(f"{place} = false;")
            return
        if node.kind is Kind.BIT_STRING:
            self.call(f'captain_cdr_number_bits(r, at, &{place}, &{node.c_name}_type, "{name}")')
            return
        with self.block():
            self.put(f"const {_c_type(one.type)} x = ({_c_type(one.type)})captain_cdr_load(r, at, {size});")
            if node.kind is Kind.ENUMERATED:
                self.item_number(one, node, place, name)
                return
            if node.kind is Kind.SMALL_BITS:
                if node.size < 64:
                    bad = f'captain_cdr_bad_bits(r, at - {size}, x, &{node.c_name}_type, "{name}")'
                    self.fail_if(f"(uint64_t)x >> {node.size} != 0", bad)
                self.put(f"{place} = ({value_type(node)})captain_cdr_turn((uint64_t)x, {node.size});")
                return
            wrong = outside(one.type, node, "x") if not node.is_extensible else ""
            if wrong:
                bad = f'captain_cdr_bad_number(r, at - {size}, (int64_t)x, &{node.c_name}_type, "{name}")'
                self.fail_if(wrong, bad)
            self.put(f"{place} = ({value_type(node)})x;")

    def item_number(self, one: RosField, node: Node, place: str, name: str) -> None:
        low, high = limits(one.type)
        first, size = contiguous(node), SIZES[one.type]
        bad = f'captain_cdr_bad_item(r, at - {size}, (int64_t)x, &{node.c_name}_type, "{name}")'
        if node.is_extensible:
            self.put(f"if (CAPTAIN_UNLIKELY(r->takes_unknown && x == {literal(unknown(one.type))}))")
            self.put(f"    {place} = CAPTAIN_UNKNOWN;", "else")
        with self.block():
            if first is None:
                least, most = memory_limits(node)
                wide = [f"x < {literal(least)}"] if low < least else []
                wide += [f"x > {literal(most)}"] if high > most else []
                self.fail_if(" || ".join([*wide, f"captain_item_index(&{node.c_name}_type, (int32_t)x) < 0"]), bad)
            else:
                last = first + len(node.names) - 1
                wrong = [f"x < {first}"] if low < first else []
                wrong += [f"x > {last}"] if high > last else []
                if wrong:
                    self.fail_if(" || ".join(wrong), bad)
            self.put(f"{place} = (int32_t)x;")

    def choice(self, one: RosField, end: Place, name: str) -> None:
        size, numbers = SIZES[one.type], numbers_of(one, end.node.fields)
        chosen, first = f"{dot(end.place)}choice", first_of(numbers)
        self.put(f"at = {_behind('at', size)};")
        self.fail_if("CAPTAIN_UNLIKELY(at > r->size)", f'captain_cdr_cut(r, at - {size}, "{name}")')
        with self.block():
            self.put(f"const int64_t x = ({_c_type(one.type)})captain_cdr_load(r, at, {size});")
            if first is not None:
                self.put(f"{chosen} = x >= {first} && x < {first + len(numbers)} ? (uint32_t)(x - {first}) + 1 : 0;")
            else:
                self.put("switch (x) {")
                for k, number in enumerate(numbers, 1):
                    if number is not None:
                        self.put(f"case {number}: {chosen} = {k}; break;")
                self.put(f"default: {chosen} = 0;", "}")
            with self.block(f"if (CAPTAIN_UNLIKELY({chosen} == 0))"):
                bad = f'captain_cdr_bad_choice(r, at - {size}, x, "{name}")'
                is_kept = end.node.is_extensible or None in numbers
                wrong = f"!r->takes_unknown || x != {literal(unknown(one.type))}" if is_kept else "true"
                self.fail_if(wrong, bad)
                if end.node.is_extensible:
                    self.put(
                        f"{chosen} = CAPTAIN_UNKNOWN;", f"{dot(end.place)}u.unknown = (captain_octets){{.count = 0}};"
                    )
        for k, f in enumerate(end.node.fields, 1):
            if f.node.kind is Kind.NULL and not f.is_pointer:
                self.put(f"if ({chosen} == {k})", f"    {dot(end.place)}u.{member(f.name)} = false;")


def _behind(at: str, size: int) -> str:
    return f"{at} + 1" if size == 1 else f"captain_cdr_align({at}, {size}) + {size}"


def _c_type(ros_type: str) -> str:
    return "uint8_t" if ros_type == "bool" else f"{ros_type}_t"


def _selector(step: Step) -> str:
    """C of the identifier of an open type; step: into the component that holds it."""
    return f"{dot(step.holder)}{member(step.node.fields[step.child.selector].name)}"
