"""Decoders in C: generates a function per struct that reads it.

Neighbouring fields of fixed width form a run: one comparison with the end, one load, constant shifts. A run may end
with an extension bit and the root value after it. If the bit is set, the offset moves back to the end of the bit.
"""

from functools import partial

from asn1.backends.c.body import counted
from asn1.backends.c.defaults import default_lines
from asn1.backends.c.names import member, value_type
from asn1.backends.c.read_values import ReadValues, Use
from asn1.layout.nodes import STRUCTS, Field, Kind, Node
from asn1.layout.widths import count_width, minimal_bits


def decoder(node: Node) -> list[str]:
    """Return the decoding function; for a list of values other than structs, preceded by the elements' function."""
    body = _Decoder()
    lines = _item_function(node) if has_item_function(node) else []
    body.put(f"{value_type(node)} *v = to;")
    body.whole(node, "*v")
    body.flush()
    name, parameters = f"{node.c_name}_read", "captain_reader *r, size_t at, void *to"
    if not node.recurs:
        return [*lines, *_function(f"size_t {name}({parameters})", body)]
    wrapper = counted(name, parameters, "captain_fail(r, at, CAPTAIN_DEPTH)")
    return [*lines, *_function(f"static size_t {name}_inside({parameters})", body), *wrapper]


def has_item_function(node: Node) -> bool:
    """Return whether a list's elements need a function of their own: those other than structs."""
    return node.kind is Kind.LIST and node.item.kind not in STRUCTS


def item_function(node: Node) -> str:
    return f"{node.c_name}_item_read" if has_item_function(node) else f"{node.item.c_name}_read"


def _item_function(node: Node) -> list[str]:
    body = _Decoder()
    is_array = node.item.kind is Kind.FIXED_OCTETS
    body.put(f"{value_type(node.item)} *v = to;")
    body.value(node.item, "v" if is_array else "*v")
    body.flush()
    return _function(f"static size_t {item_function(node)}(captain_reader *r, size_t at, void *to)", body)


def _function(head: str, body: "_Decoder") -> list[str]:
    variables = [f"    {type_} {name};" for type_, name in (("uint64_t", "word"), ("uint64_t", "x")) if body.uses(name)]
    unused = [f"    (void){name};" for name in ("v", "r") if not body.uses(name)]
    exits = [
        line
        for status, label in body.exits.items()
        for line in (f"{label}:", f"    return captain_fail(r, at, {status});")
    ]
    return [head, "{", *body.lines[:1], *variables, *unused, *body.lines[1:], "    return at;", *exits, "}", ""]


# Bits of the shortest general length. If the root's length has at most this many, it is loaded together with the
# extension bit.
_LENGTH = 8


class _Decoder(ReadValues):
    """Decoder of SEQUENCE, CHOICE and SEQUENCE OF."""

    def sequence(self, node: Node, to: str) -> None:
        if node.is_extensible:
            self.put("bool extended;")
            self.add(1, lambda bits: self.put(f"extended = {bits} != 0;"))
        self.preamble(node.root, to)
        for f in node.root:
            self.component(node, f, to)
        if node.is_extensible:
            self.flush()
            self.additions(node, to)
        elif not node.fields:
            self.put(f"{to}empty = false;")

    def preamble(self, fields: list[Field], to: str) -> None:
        for f in fields:
            if f.is_optional and not f.is_mandatory:
                self.add(1, partial(self.present, f"{to}has_{member(f.name)}"))

    def present(self, flag: str, bits: str) -> None:
        self.put(f"{flag} = {bits} != 0;")

    def component(self, node: Node, f: Field, to: str) -> None:
        name = f"{to}{member(f.name)}"
        if not f.is_optional or f.is_mandatory:
            self.held(node, f, to)
            return
        self.flush()
        with self.block(f"if ({to}has_{member(f.name)})"):
            self.held(node, f, to)
            self.flush()
        if f.default is not None:
            with self.block("else"):
                self.default(f, name)

    def held(self, node: Node, f: Field, to: str) -> None:
        """Write code for a component that is present, stored in place or behind a pointer."""
        name = f"{to}{member(f.name)}"
        if f.node.kind is Kind.OPEN:
            selector = f"{to}{member(node.fields[f.node.selector].name)}"
            self.call(f"captain_decode_open(r, at, &{f.node.c_name}_type, (int64_t){selector}, &{name})")
        elif f.is_pointer:
            self.flush()
            self.put(f"{name} = {_take(f.node)};", f"if ({name} == NULL)", "    return CAPTAIN_FAILED;")
            self.call(f"{f.node.c_name}_read(r, at, {name})")
        else:
            self.value(f.node, name)

    def default(self, f: Field, name: str) -> None:
        self.put(*default_lines(f.node, f.default, name))

    def additions(self, node: Node, to: str) -> None:
        self.put(f"{to}additions = NULL;")
        if not node.additions:
            with self.block("if (extended)"):
                self.call(f"captain_get_all_additions(r, at, &{to}additions)")
            return
        for f in node.fields[node.root_count :]:
            self.put(f"{to}has_{member(f.name)} = false;")
            if f.default is not None:
                self.default(f, f"{to}{member(f.name)}")
        with self.block("if (extended)"):
            self.put("captain_bitmap bitmap;", "captain_outside outside;")
            self.call("captain_get_bitmap(r, at, &bitmap)")
            for index, group in enumerate(node.groups()):
                with self.block(f"if (bitmap.known >> {63 - index} & 1)"):
                    self.addition(node, group, to)
            self.call(f"captain_get_additions(r, at, &bitmap, {node.additions}, &{to}additions)")

    def addition(self, node: Node, group: list[Field], to: str) -> None:
        self.call("captain_open_begin(r, at, &outside)")
        for f in group:
            if f.is_mandatory or not f.in_group:
                self.put(f"{to}has_{member(f.name)} = true;")
        if group and group[0].in_group:
            self.preamble(group, to)
            for f in group:
                self.component(node, f, to)
        else:
            self.held(node, group[0], to)
        self.call("captain_open_end(r, at, &outside)")

    # ------------------------------------------------------------ CHOICE and SEQUENCE OF

    def choice(self, node: Node) -> None:
        width = (node.root_count - 1).bit_length()

        def use(bits: str) -> None:
            if bits != "x":
                self.put(f"x = {bits};")
            self.limit("x", node.root_count - 1, width, "CAPTAIN_ALTERNATIVE")
            self.put("v->choice = (uint32_t)x + 1;")

        if node.is_extensible:
            self.add(1 + width, lambda bits: self.choice_extended(node, bits, width, use))
        else:
            self.add(width, use)
        self.flush()
        with self.block("switch (v->choice)"):
            for k, f in enumerate(node.fields[: node.root_count], 1):
                self.alternative(k, f)

    def alternative(self, k: int, f: Field) -> None:
        with self.block(f"case {k}:"):
            self.choose(f)
            self.flush()
            self.put("break;")

    def choose(self, f: Field) -> None:
        name = f"v->u.{member(f.name)}"
        if f.is_pointer:
            self.put(
                f"{f.node.struct_name} *chosen = {_take(f.node)};",
                "if (chosen == NULL)",
                "    return CAPTAIN_FAILED;",
            )
            self.put(f"{name} = chosen;")
            self.call(f"{f.node.c_name}_read(r, at, chosen)")
        else:
            self.value(f.node, name)

    def choice_extended(self, node: Node, bits: str, width: int, use: Use) -> None:
        self.put(f"x = {bits};")
        with self.block(f"if (x >> {width} != 0)"):
            self.put(*(["captain_outside outside;"] if node.additions else []), "uint32_t index = 0;")
            if width:
                self.put(f"at -= {width};")
            self.call("captain_get_small(r, at, &index)")
            if not node.additions:
                self.put("v->choice = CAPTAIN_UNKNOWN + index;", "return captain_get_unknown(r, at, &v->u.unknown);")
            else:
                self.known_addition(node)
        use("x")

    def known_addition(self, node: Node) -> None:
        with self.block(f"if (index >= {node.additions})"):
            self.put("v->choice = CAPTAIN_UNKNOWN + index;", "return captain_get_unknown(r, at, &v->u.unknown);")
        self.put(f"v->choice = index + {node.root_count + 1};")
        self.call("captain_open_begin(r, at, &outside)")
        with self.block("switch (index)"):
            for index, f in enumerate(node.fields[node.root_count :]):
                with self.block(f"case {index}:"):
                    self.choose(f)
                    self.flush()
                    self.put("break;")
        self.put("return captain_open_end(r, at, &outside);")

    def list_(self, node: Node) -> None:
        width, low, high = count_width(node.bounds), node.bounds.low or 0, node.bounds.high
        if width is None:
            if node.is_extensible:
                self.add(1, lambda bits: self.put(f"x = {bits};"))
                self.flush()
            self.general(node, "x == 0" if node.is_extensible else "")
            return

        def use(bits: str) -> None:
            if width:
                if bits != "x" and high is not None and high - low < (1 << width) - 1:
                    self.put(f"x = {bits};")
                    bits = "x"
                if bits == "x":
                    self.limit("x", (high or 0) - low, width, "CAPTAIN_SIZE")
                self.put(f"v->count = (uint32_t){bits}{f' + {low}' if low else ''};")
            else:
                self.put(f"v->count = {low};")

        if node.is_extensible and width <= _LENGTH:
            self.add(1 + width, lambda bits: self.list_extended(node, bits, width, use))
        elif node.is_extensible:
            self.add(1, lambda bits: self.list_extended(node, bits, 0, lambda _: None))
            self.flush()
            self.add(width, use)
        elif width:
            self.add(width, use)
        else:
            use("0")
        self.flush()
        self.put("v->items = NULL;")
        if low:
            self.items(node)
        else:
            with self.block("if (v->count != 0)"):
                self.items(node)

    def list_extended(self, node: Node, bits: str, width: int, use: Use) -> None:
        self.put(f"x = {bits};")
        with self.block(f"if (x >> {width} != 0)"):
            if width:
                self.put(f"at -= {width};")
            self.general(node, None)
            self.put("return at;")
        use("x")

    def general(self, node: Node, root: str | None) -> None:
        """Write code for a list with a general length.

        root  C condition under which the bounds apply; "" for always, None for never.
        """
        self.put("captain_list list;")
        least = minimal_bits(node.item, {})
        self.call(f"captain_decode_items(r, at, &list, sizeof *v->items, {least}, {item_function(node)})")
        self.put("v->count = list.count;", "v->items = list.items;")
        low, high = node.bounds.low, node.bounds.high
        wrong = ([f"v->count < {low}"] if low else []) + ([f"v->count > {high}"] if high is not None else [])
        if wrong and root is not None:
            outside = " || ".join(wrong)
            self.put(f"if ({f'{root} && ({outside})' if root else outside})", f"    goto {self.exit('CAPTAIN_SIZE')};")

    def items(self, node: Node) -> None:
        self.put(f"v->items = captain_take_items(r, at, v->count, sizeof *v->items, {minimal_bits(node.item, {})});")
        self.put("if (v->items == NULL)", "    return CAPTAIN_FAILED;")
        with self.block("for (uint32_t i = 0; i < v->count; i++)"):
            self.call(f"{item_function(node)}(r, at, &v->items[i])")


def _take(node: Node) -> str:
    """Return the C expression that allocates a struct. It fails if the remaining octets cannot contain one."""
    return f"captain_take_items(r, at, 1, sizeof({node.struct_name}), {minimal_bits(node, {})})"
