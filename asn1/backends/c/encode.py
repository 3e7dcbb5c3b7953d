"""Encoders in C: generates a function per struct that writes it.

Neighbouring fields of fixed width are collected in a register and stored together. Encoding fails for numbers and sizes
outside the effective bounds, and for unknown alternatives. All other constraints are checked by validate only.
"""

from asn1.backends.c.body import counted
from asn1.backends.c.defaults import differs
from asn1.backends.c.names import member, value_type
from asn1.backends.c.write_values import WriteValues
from asn1.layout.nodes import STRUCTS, Field, Kind, Node
from asn1.layout.widths import EMPTY_MAX, count_width, is_endless


def encoder(node: Node) -> list[str]:
    """Return the encoding function; for a list of values other than structs, preceded by the elements' function."""
    body = _Encoder()
    lines = _item_function(node) if node.kind is Kind.LIST and node.item.kind not in STRUCTS else []
    body.put(f"const {value_type(node)} *v = from;")
    body.whole(node, "*v")
    body.flush()
    name, parameters = f"{node.c_name}_write", "captain_writer *w, size_t at, const void *from"
    if not node.recurs:
        return [*lines, *_function(f"size_t {name}({parameters})", body)]
    wrapper = counted(name, parameters, "captain_refuse(w, CAPTAIN_DEPTH)")
    return [*lines, *_function(f"static size_t {name}_inside({parameters})", body), *wrapper]


def item_function(node: Node) -> str:
    return f"{node.item.c_name}_write" if node.item.kind in STRUCTS else f"{node.c_name}_item_write"


def _item_function(node: Node) -> list[str]:
    body = _Encoder()
    body.put(f"const {value_type(node.item)} *v = from;")
    body.value(node.item, "v" if node.item.kind is Kind.FIXED_OCTETS else "*v")
    body.flush()
    return _function(f"static size_t {item_function(node)}(captain_writer *w, size_t at, const void *from)", body)


def _function(head: str, body: "_Encoder") -> list[str]:
    unused = [f"    (void){name};" for name in ("v", "w") if not body.uses(name)]
    exits = [
        line
        for status, label in body.exits.items()
        for line in (f"{label}:", f"    return captain_refuse(w, {status});")
    ]
    return [head, "{", *body.lines[:1], *unused, *body.lines[1:], "    return at;", *exits, "}", ""]


class _Encoder(WriteValues):
    """Encoder of SEQUENCE, CHOICE and SEQUENCE OF."""

    def sequence(self, node: Node, of: str) -> None:
        known = self.known_additions(node, of) if node.is_extensible else "0"
        if node.is_extensible:
            extended = "captain_is_extended(v->additions)"
            extended = f"(known != 0 || {extended})" if node.additions else extended
            self.put(f"const bool extended = {extended};")
            self.add(1, "(uint64_t)extended")
        flags = self.preamble(node.root, of)
        for f in node.root:
            self.component(node, f, of, flags)
        if node.is_extensible:
            self.flush()
            with self.block("if (extended)"):
                self.call(f"captain_encode_bitmap(w, at, {node.additions}, {known}, v->additions)")
                for index, group in enumerate(node.groups()):
                    with self.block(f"if (known >> {63 - index} & 1)"):
                        self.addition(node, group, of)
                self.step("captain_put_additions(w, at, v->additions)")

    def known_additions(self, node: Node, of: str) -> str:
        """Write the bitmap of the present additions, and return its C expression.

        The first addition is the highest bit.
        """
        if not node.additions:
            return "0"
        parts = []
        for index, group in enumerate(node.groups()):
            there = " || ".join(_is_there(f, of) for f in group)
            parts.append(f"(uint64_t)({there}) << {63 - index}")
        self.put("const uint64_t known = " + "\n        | ".join(parts) + ";")
        return "known"

    def preamble(self, fields: list[Field], of: str) -> dict[str, str]:
        flags = {}
        for f in fields:
            if f.is_optional and not f.is_mandatory:
                flag = f"{of}has_{member(f.name)}"
                if f.default is not None:
                    flag = self.name("p")
                    self.put(f"const bool {flag} = {_is_there(f, of)};")
                flags[f.name] = flag
                self.add(1, f"(uint64_t){flag}")
        return flags

    def component(self, node: Node, f: Field, of: str, flags: dict[str, str]) -> None:
        if f.name not in flags:
            self.held(node, f, of)
            return
        self.flush()
        with self.block(f"if ({flags[f.name]})"):
            self.held(node, f, of)
            self.flush()

    def held(self, node: Node, f: Field, of: str) -> None:
        name = f"{of}{member(f.name)}"
        if f.node.kind is Kind.OPEN:
            selector = f"{of}{member(node.fields[f.node.selector].name)}"
            self.call(f"captain_encode_open(w, at, &{f.node.c_name}_type, (int64_t){selector}, &{name})")
        elif f.is_pointer:
            self.pointed(f, name)
        else:
            self.value(f.node, name)

    def pointed(self, f: Field, name: str) -> None:
        self.flush()
        self.refuse_if(f"{name} == NULL", "CAPTAIN_PRESENCE")
        self.call(f"{f.node.c_name}_write(w, at, {name})")

    def addition(self, node: Node, group: list[Field], of: str) -> None:
        self.put("const size_t start = at;")
        self.step("captain_put_open(w, at)")
        if group[0].in_group:
            missing = [f"!{of}has_{member(f.name)}" for f in group if f.is_mandatory]
            if missing and len(group) > 1:
                self.refuse_if(" || ".join(missing), "CAPTAIN_PRESENCE")
            flags = self.preamble(group, of)
            for f in group:
                self.component(node, f, of, flags)
        else:
            self.held(node, group[0], of)
        self.flush()
        self.step("captain_put_close(w, start, at)")

    # ------------------------------------------------------------ CHOICE and SEQUENCE OF

    def choice(self, node: Node) -> None:
        width = (node.root_count - 1).bit_length()
        with self.block("switch (v->choice)"):
            for k, f in enumerate(node.fields, 1):
                with self.block(f"case {k}:"):
                    if k <= node.root_count:
                        self.add(node.is_extensible + width, f"UINT64_C({k - 1})" if k > 1 else "0")
                        self.choose(f)
                    else:
                        self.extension(f, k - 1 - node.root_count)
                    self.flush()
                    self.put("break;")
            with self.block("default:"):
                if node.is_extensible:
                    self.refuse_if("v->choice < CAPTAIN_UNKNOWN", "CAPTAIN_ALTERNATIVE")
                    self.step("captain_put(w, at, 1, 1)")
                    self.step("captain_put_small(w, at, v->choice - CAPTAIN_UNKNOWN)")
                    self.step("captain_put_unknown(w, at, &v->u.unknown)")
                    self.put("break;")
                else:
                    self.put("return captain_refuse(w, CAPTAIN_ALTERNATIVE);")

    def extension(self, f: Field, index: int) -> None:
        self.put("size_t start;")
        self.step("captain_put(w, at, 1, 1)")
        self.step(f"captain_put_small(w, at, {index})")
        self.put("start = at;")
        self.step("captain_put_open(w, at)")
        self.choose(f)
        self.flush()
        self.step("captain_put_close(w, start, at)")

    def choose(self, f: Field) -> None:
        name = f"v->u.{member(f.name)}"
        if f.is_pointer:
            self.pointed(f, name)
        else:
            self.value(f.node, name)

    def list_(self, node: Node) -> None:
        width, low, high = count_width(node.bounds), node.bounds.low or 0, node.bounds.high
        wrong = ([f"v->count < {low}"] if low else []) + ([] if high is None else [f"v->count > {high}"])
        general = f"captain_encode_items(w, at, v->items, v->count, sizeof *v->items, {item_function(node)})"
        if is_endless(node):
            self.refuse_if(f"v->count > {EMPTY_MAX}", "CAPTAIN_SIZE")
        if node.is_extensible:
            with self.block(f"if ({' || '.join(wrong) or '0'})"):
                self.step("captain_put(w, at, 1, 1)")
                self.put(f"return {general};")
            self.add(1, "0")
        elif wrong:
            self.refuse_if(" || ".join(wrong), "CAPTAIN_SIZE")
        if width is None:
            self.flush()
            self.put(f"at = {general};")
            return
        self.add(width, f"(uint64_t)(v->count - {low})" if low else "(uint64_t)v->count")
        self.flush()
        with self.block("for (uint32_t i = 0; i < v->count; i++)"):
            self.call(f"{item_function(node)}(w, at, &v->items[i])")


def _is_there(f: Field, of: str) -> str:
    name = member(f.name)
    if f.default is None:
        return f"{of}has_{name}"
    return f"({of}has_{name} && {differs(f.node, f.default, f'{of}{name}')})"
