"""Readers of CDR in C: generates a function per message and type that fills a struct.

Absent fields are skipped. If the presence flag comes after its field, the flag is read first by a look-ahead.
"""

from asn1.backends.c.defaults import default_lines, differs
from asn1.backends.c.names import member, value_type
from asn1.backends.ros2.cdr.lines import Functions
from asn1.backends.ros2.cdr.places import Place, dot, is_struct, pointer
from asn1.backends.ros2.cdr.presence import Presence
from asn1.backends.ros2.cdr.read_numbers import choice, number
from asn1.backends.ros2.cdr.reading import Reading
from asn1.backends.ros2.cdr.shapes import SIZES
from asn1.backends.ros2.cdr.write import element, is_alias, unflagged
from asn1.backends.ros2.model import Role, RosField
from asn1.layout.nodes import Kind, Node


def reader(functions: Functions, message: str, node: Node) -> list[str]:
    """Return the reading function for a message and a type."""
    body = _Reader(functions)
    body.message(message, node, "(*v)", "")
    body.finish(node)
    head = f"static size_t {functions.of(message, node)}_read(captain_cdr_reader *r, size_t at, void *to)"
    first = [f"    {node.struct_name} *v = to;", *(f"    uint32_t {index} = 0;" for index in body.indexes)]
    unused = [f"    (void){word};" for word in ("v", "r") if not body.uses(word)]
    return [head, "{", *first, *unused, *body.lines, "    return at;", *body.exits, "}", ""]


class _Reader(Reading):
    def message(self, name: str, node: Node, place: str, names: str) -> None:
        fields = self.shapes.fields(name)
        flags = frozenset(one.source for one in fields if one.role is Role.PRESENT)
        of = Presence(self, fields, node, place, names, flags, list(unflagged(fields, node, place)))
        if is_struct(node) and not is_alias(fields):
            of.begin(node, place, ())
        if node.recurs:
            with self.block("if (++r->depth > CAPTAIN_MAX_RECURSION)"):
                self.fail("captain_cdr_too_deep(r, at)")
        for index, one in enumerate(fields):
            self.field(of, index, one)
        for step in of.opens.values():
            of.close(step)

    def finish(self, node: Node) -> None:
        if node.recurs:
            self.put("r->depth--;")

    def field(self, of: Presence, index: int, one: RosField) -> None:
        if one.role is Role.HEADER:
            self.skip(one, of.name(one))
            return
        if one.role is Role.PRESENT:
            of.flag(index, one)
            return
        end = of.follow(one.source)
        for step in end.steps:
            of.enter(index, step, of.follow(step.path))
        if not end.condition:
            self.held(of, one, end)
            return
        with self.block(f"if ({end.condition})"):
            self.held(of, one, end)
        with self.block("else"):
            if index in of.looks:
                self.put(f"at = {of.looks[index]};")
            else:
                self.skip(one, of.name(one))
            self.absent(end)

    def absent(self, end: Place) -> None:
        """Write code that assigns the DEFAULT of an absent component."""
        step = end.steps[-1]
        if step.node.kind is not Kind.SEQUENCE or step.field.default is None:
            return
        outer = " && ".join(one.condition for one in end.steps[:-1] if one.condition)
        with self.block(f"if ({outer})" if outer else ""):
            self.put(*default_lines(step.child, step.field.default, step.place))

    def held(self, of: Presence, one: RosField, end: Place) -> None:
        name = of.name(one)
        match one.role:
            case Role.CHOICE:
                choice(self, one, end, name)
            case Role.BITS_UNUSED if end.node.kind is Kind.SMALL_BITS:
                self.call(f'captain_cdr_get_small_unused(r, at, &{end.node.c_name}_type, "{name}")')
            case Role.BITS_UNUSED:
                self.call(f'captain_cdr_get_unused(r, at, &{end.place}, &{end.node.c_name}_type, "{name}")')
            case _:
                self.value(one, end.node, end.place, name)
                self.default(end)

    def default(self, end: Place) -> None:
        """Write code that sets the flag of a component with a DEFAULT, if the message has no flag for it.

        An addition is present if it differs from its DEFAULT. In the root the flag is set, and encode() compares.
        """
        f = end.steps[-1].field if end.steps and end.steps[-1].node.kind is Kind.SEQUENCE else None
        if f is not None and f.default is not None and not end.steps[-1].condition:
            flag = f"{dot(end.steps[-1].holder)}has_{member(f.name)}"
            self.put(f"{flag} = {differs(f.node, f.default, end.place) if f.addition else 'true'};")

    def value(self, one: RosField, node: Node, place: str, name: str) -> None:
        if one.is_array:
            self.array(one, node, place, name)
        elif one.type == "string":
            kind = "oid" if node.kind in (Kind.OID, Kind.RELATIVE_OID) else "text"
            self.call(f'captain_cdr_get_{kind}(r, at, &{place}, &{node.c_name}_type, "{name}")')
        elif one.type in SIZES:
            number(self, one, node, place, name)
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
            case _:
                self.list_(one, node, place, name)

    def wide(self, node: Node, place: str, name: str) -> None:
        """Write code for octets that ROS has as 64-bit numbers."""
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
