"""Layout to C: a function per struct that reads it.

Neighbouring fields of fixed width make a run: one comparison with the end, one load, constant shifts. An extension
bit may end a run together with what it decides about; where it is set, the offset goes back to behind it.
"""

from collections.abc import Callable

from asn1.c.body import RUN_MAX, Body
from asn1.c.names import contiguous, literal, member, unsigned, value_type
from asn1.nodes import STRUCTS, Field, Kind, Node
from asn1.types import Default
from asn1.widths import count_width, is_flat, minimal_bits

Use = Callable[[str], None]
"""Told the expression of the bits, right aligned in a uint64_t."""


def decoder(node: Node) -> list[str]:
    """The function, and before it that of a list's elements where they are no structs."""
    body = _Decoder()
    lines = _item_function(node) if has_item_function(node) else []
    name = node.c_name
    body.put(f"{name} *v = to;" if node.kind in STRUCTS else f"{value_type(node)} *v = to;")
    if node.recurs and node.kind is Kind.SEQUENCE:
        body.put("if (++r->depth > CAPTAIN_MAX_RECURSION)", f"    goto {body.exit('CAPTAIN_DEPTH')};")
    match node.kind:
        case Kind.SEQUENCE:
            body.sequence(node, "v->")
        case Kind.CHOICE:
            body.choice(node)
        case Kind.LIST:
            body.list_(node)
        case _:
            body.value(node, "v" if node.kind is Kind.FIXED_OCTETS else "*v")
    body.flush()
    if node.recurs and node.kind is Kind.SEQUENCE:
        body.put("r->depth--;")
    return [*lines, *_function(f"size_t {name}_read(captain_reader *r, size_t at, void *to)", body)]


def has_item_function(node: Node) -> bool:
    """Elements that are no structs need a function where a list can have a general length."""
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


class _Decoder(Body):
    def __init__(self) -> None:
        super().__init__()
        self.run: list[tuple[int, Use]] = []

    def add(self, width: int, use: Use) -> None:
        """One more field of the run."""
        if sum(bits for bits, _ in self.run) + width > RUN_MAX:
            self.flush()
        self.run.append((width, use))

    def flush(self) -> None:
        """What has been collected becomes code."""
        total = sum(bits for bits, _ in self.run)
        run, self.run = self.run, []
        if total:
            self.put(f"if (CAPTAIN_UNLIKELY(r->end - at < {total}))", f"    goto {self.exit('CAPTAIN_TRUNCATED')};")
            self.put("word = captain_load(r, at);", f"at += {total};")
        done = 0
        for width, use in run:
            use(_bits(done, width))
            done += width

    def call(self, expression: str) -> None:
        self.flush()
        self.put(f"at = {expression};", "if (at == CAPTAIN_FAILED)", "    return at;")

    def limit(self, name: str, most: int, width: int, status: str) -> None:
        if most < (1 << width) - 1:
            self.put(f"if ({name} > {unsigned(most)})", f"    goto {self.exit(status)};")

    # ------------------------------------------------------------ values

    def value(self, node: Node, to: str) -> None:
        """Read a value into an lvalue."""
        match node.kind:
            case Kind.BOOLEAN:
                self.add(1, lambda bits: self.put(f"{to} = {bits} != 0;"))
            case Kind.NULL:
                self.put(f"{to} = false;")
            case Kind.INTEGER:
                self.integer(node, to)
            case Kind.ENUMERATED:
                self.enumerated(node, to)
            case Kind.SMALL_BITS:
                type_ = value_type(node)
                self.number(node.size, lambda bits: self.put(f"{to} = ({type_}){bits};"))
            case Kind.FIXED_OCTETS:
                self.call(f"captain_get_octets(r, at, {to}, {node.size})")
            case Kind.SEQUENCE if is_flat(node):
                self.sequence(node, f"{to}.")
            case kind if kind in STRUCTS:
                self.call(f"{node.c_name}_read(r, at, &{to})")
            case Kind.OPEN:
                raise ValueError("an open type outside of a SEQUENCE")
            case _:
                self.call(f"captain_decode_string(r, at, &{node.c_name}_type, &{to})")

    def number(self, width: int, use: Use) -> None:
        """Bits of any width up to 64."""
        if width <= RUN_MAX:
            self.add(width, use)
        else:
            self.call(f"captain_get_long(r, at, {width}, &x)")
            use("x")

    def integer(self, node: Node, to: str) -> None:
        low, width = node.bounds.low, node.bounds.width
        if node.is_extensible:
            slow = f"captain_get_unconstrained(r, at, &{to})"
            self.extensible(
                width, 16, lambda bits: self.constrained(node, to, bits), slow, lambda: self.unbounded(node, to)
            )
        elif width is None:
            self.unbounded(node, to)
        elif width == 0:
            self.put(f"{to} = {literal(low or 0)};")
        else:
            self.number(width, lambda bits: self.constrained(node, to, bits))

    def constrained(self, node: Node, to: str, bits: str) -> None:
        low, high, width = node.bounds.low or 0, node.bounds.high or 0, node.bounds.width or 0
        type_ = value_type(node)
        if high - low < (1 << width) - 1 and bits != "x":
            self.put(f"x = {bits};")
            bits = "x"
        if bits == "x":
            self.limit("x", high - low, width, "CAPTAIN_RANGE")
        if low == 0:
            self.put(f"{to} = ({type_}){bits};")
        elif low > 0:
            self.put(f"{to} = ({type_})({bits} + {unsigned(low)});")
        else:
            self.put(f"{to} = ({type_})({bits} - {unsigned(-low)});")

    def unbounded(self, node: Node, to: str) -> None:
        """At one end or both. int64_t in memory."""
        if node.bounds.width is not None:
            self.number(node.bounds.width, lambda bits: self.constrained(node, to, bits))
            self.flush()
        elif node.bounds.low is not None:
            self.call(f"captain_get_semi(r, at, {literal(node.bounds.low)}, &{to})")
        else:
            self.call(f"captain_get_unconstrained(r, at, &{to})")
            if node.bounds.high is not None:
                self.put(f"if ({to} > {literal(node.bounds.high)})", f"    goto {self.exit('CAPTAIN_RANGE')};")

    def extensible(self, width: int | None, spare: int, use: Use, slow: str, root: Callable[[], None]) -> None:
        """An extension bit and what it decides about: `slow` where it is set.

        Both in one run where the root takes `width` bits and what else follows would take at least `spare`; else `root`
        reads what follows a zero.
        """
        if width is not None and width <= spare:
            self.add(1 + width, lambda bits: self.decide(bits, width, use, slow))
            self.flush()
            return
        self.add(1, lambda bits: self.put(f"x = {bits};"))
        self.flush()
        with self.block("if (x != 0)"):
            self.call(slow)
        with self.block("else"):
            root()
            self.flush()

    def decide(self, bits: str, width: int, use: Use, slow: str) -> None:
        self.put(f"x = {bits};")
        with self.block(f"if (x >> {width} != 0)"):
            if width:
                self.put(f"at -= {width};")
            self.call(slow)
        with self.block("else"):
            use("x")

    def enumerated(self, node: Node, to: str) -> None:
        width = (node.root_count - 1).bit_length()

        def use(bits: str) -> None:
            first = contiguous(node)
            if bits != "x" and (node.root_count < 1 << width or first is None):
                self.put(f"x = {bits};")
                bits = "x"
            if bits == "x":
                self.limit("x", node.root_count - 1, width, "CAPTAIN_ALTERNATIVE")
            if first is None:
                self.put(f"{to} = (int32_t){node.c_name}_type.names[{bits}].value;")
            else:
                self.put(f"{to} = (int32_t){bits}{f' + {first}' if first else ''};")

        def root() -> None:
            self.add(width, use)

        if node.is_extensible:
            self.extensible(width, 7, use, f"captain_get_item(r, at, &{node.c_name}_type, &{to})", root)
        else:
            self.add(width, use)

    # ------------------------------------------------------------ SEQUENCE

    def sequence(self, node: Node, to: str) -> None:
        """to: "v->" or "v->heading."."""
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
                self.present(f"{to}has_{member(f.name)}")

    def present(self, flag: str) -> None:
        self.add(1, lambda bits: self.put(f"{flag} = {bits} != 0;"))

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
        """A component that is there, in its place or behind its pointer."""
        name = f"{to}{member(f.name)}"
        if f.node.kind is Kind.OPEN:
            selector = f"{to}{member(node.fields[f.node.selector].name)}"
            self.call(f"captain_decode_open(r, at, &{f.node.c_name}_type, (int64_t){_later(self, selector)}, &{name})")
        elif f.is_pointer:
            self.flush()
            self.put(f"{name} = captain_take(r, at, sizeof({f.node.c_name}));", f"if ({name} == NULL)")
            self.put("    return CAPTAIN_FAILED;")
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
            kind = f.node.c_name
            self.put(
                f"{kind} *chosen = captain_take(r, at, sizeof *chosen);",
                "if (chosen == NULL)",
                "    return CAPTAIN_FAILED;",
            )
            self.put(f"{name} = chosen;")
            self.call(f"{kind}_read(r, at, chosen)")
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
            self.general(node, is_root=not node.is_extensible)
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

        if node.is_extensible:
            self.add(1 + width, lambda bits: self.list_extended(node, bits, width, use))
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
            self.general(node, is_root=False)
            self.put("return at;")
        use("x")

    def general(self, node: Node, is_root: bool) -> None:
        self.put("captain_list list;")
        least = minimal_bits(node.item, {})
        self.call(f"captain_decode_items(r, at, &list, sizeof *v->items, {least}, {item_function(node)})")
        self.put("v->count = list.count;", "v->items = list.items;")
        wrong = []
        if is_root and node.bounds.low:
            wrong.append(f"v->count < {node.bounds.low}")
        if is_root and node.bounds.high is not None:
            wrong.append(f"v->count > {node.bounds.high}")
        if wrong:
            self.put(f"if ({' || '.join(wrong)})", f"    goto {self.exit('CAPTAIN_SIZE')};")

    def items(self, node: Node) -> None:
        self.put(f"v->items = captain_take_items(r, at, v->count, sizeof *v->items, {minimal_bits(node.item, {})});")
        self.put("if (v->items == NULL)", "    return CAPTAIN_FAILED;")
        with self.block("for (uint32_t i = 0; i < v->count; i++)"):
            self.call(f"{item_function(node)}(r, at, &v->items[i])")


def _later(body: _Decoder, selector: str) -> str:
    """The selector has been read by then: a call ends the run before it."""
    body.flush()
    return selector


def _bits(done: int, width: int) -> str:
    shift = 64 - done - width
    if width == 0:
        return "UINT64_C(0)"
    if done == 0:
        return f"(word >> {shift})"
    shifted = f"word >> {shift}" if shift else "word"
    return f"({shifted} & {(1 << width) - 1:#x})"


def default_lines(node: Node, default: Default, name: str) -> list[str]:
    """Statements that put a DEFAULT into its place."""
    match node.kind:
        case Kind.BOOLEAN:
            return [f"{name} = {'true' if default else 'false'};"]
        case Kind.INTEGER if isinstance(default, int):
            return [f"{name} = {literal(default)};"]
        case Kind.ENUMERATED:
            return [f"{name} = {next(item.value for item in node.names if item.name == default)};"]
        case Kind.SMALL_BITS if isinstance(default, tuple):
            return [f"{name} = {unsigned(int.from_bytes(default[0], 'big') >> (-default[1] % 8))};"]
        case Kind.FIXED_OCTETS if isinstance(default, bytes):
            return [f"{name}[{i}] = {octet:#04x};" for i, octet in enumerate(default)]
        case _:
            raise ValueError(f"{node.c_name}: a DEFAULT of this type: {default!r}")
