"""Decoders of values other than structs; fixed widths form one run of bits."""

from collections.abc import Callable

from asn1.backends.c.body import RUN_MAX, Body
from asn1.backends.c.names import contiguous, literal, unsigned, value_type
from asn1.layout.nodes import STRUCTS, Kind, Node
from asn1.layout.widths import is_flat

Use = Callable[[str], None]
"""Told the expression of the bits, right aligned in a uint64_t."""


class ReadValues(Body):
    """Decoder of values other than structs. Fields of fixed width are collected in a run of bits."""

    def __init__(self) -> None:
        super().__init__()
        self.run: list[tuple[int, Use]] = []

    def add(self, width: int, use: Use) -> None:
        """Add a field to the run. use: called with the C expression of its bits."""
        if sum(bits for bits, _ in self.run) + width > RUN_MAX:
            self.flush()
        self.run.append((width, use))

    def flush(self) -> None:
        """Write the code for the collected run."""
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

    def value(self, node: Node, to: str) -> None:
        """Write code that reads a value into an lvalue.

        Raises ValueError for an open type: only its SEQUENCE knows the selected row.
        """
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
        """Write code for a field of up to 64 bits."""
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
        """Write code for an INTEGER with at least one open end. It is an int64_t in memory."""
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
        """Write code for an extension bit and the value after it.

        width  bits of the root value; None for a general length.
        spare  greatest width at which extension bit and root value are loaded together.
        use    called with the C expression of these bits.
        slow   C expression that reads an extension value.
        root   writes code for the root value after a separate extension bit of zero.
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


def _bits(done: int, width: int) -> str:
    shift = 64 - done - width
    if width == 0:
        return "UINT64_C(0)"
    if done == 0:
        return f"(word >> {shift})"
    shifted = f"word >> {shift}" if shift else "word"
    return f"({shifted} & {(1 << width) - 1:#x})"
