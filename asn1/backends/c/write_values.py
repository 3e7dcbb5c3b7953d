"""Encoders of values other than structs; fixed widths form one run of bits."""

from asn1.backends.c.body import RUN_MAX, Body
from asn1.backends.c.names import contiguous, literal, unsigned
from asn1.layout.memory import number_octets
from asn1.layout.nodes import STRUCTS, Kind, Node
from asn1.layout.widths import is_flat


class WriteValues(Body):
    """Encoder of values other than structs. Fields of fixed width are collected in a run of bits."""

    def __init__(self) -> None:
        super().__init__()
        self.run: list[tuple[int, str]] = []

    def add(self, width: int, bits: str) -> None:
        """Add a field to the run. bits: C expression of a uint64_t without bits above the width."""
        if width == 0:
            return
        if sum(w for w, _ in self.run) + width > RUN_MAX:
            self.flush()
        self.run.append((width, bits))

    def flush(self) -> None:
        """Write the code for the collected run."""
        left = total = sum(width for width, _ in self.run)
        parts = []
        for width, bits in self.run:
            left -= width
            if bits != "0":
                parts.append(f"{bits} << {left}" if left else bits)
        self.run = []
        if total:
            self.step(f"captain_put(w, at, {' | '.join(parts) or '0'}, {total})")

    def step(self, expression: str) -> None:
        """Write a call that cannot fail."""
        if self.run:
            self.flush()
        self.put(f"at = {expression};")

    def call(self, expression: str) -> None:
        if self.run:
            self.flush()
        self.put(f"at = {expression};", "if (at == CAPTAIN_FAILED)", "    return at;")

    def temporary(self, expression: str) -> str:
        name = self.name("x")
        self.put(f"const uint64_t {name} = {expression};")
        return name

    def refuse_if(self, condition: str, status: str) -> None:
        self.put(f"if ({condition})", f"    goto {self.exit(status)};")

    def value(self, node: Node, of: str) -> None:
        """Write code that encodes an lvalue.

        Raises ValueError for an open type: only its SEQUENCE knows the selected row.
        """
        match node.kind:
            case Kind.BOOLEAN:
                self.add(1, f"(uint64_t){of}")
            case Kind.NULL:
                pass
            case Kind.INTEGER:
                self.integer(node, of)
            case Kind.ENUMERATED:
                self.enumerated(node, of)
            case Kind.SMALL_BITS:
                if node.size < 8 * number_octets(node)[0]:
                    self.refuse_if(f"{of} >> {node.size} != 0", "CAPTAIN_SIZE")
                self.number(node.size, f"(uint64_t){of}")
            case Kind.FIXED_OCTETS:
                self.step(f"captain_put_octets(w, at, {of}, {node.size})")
            case Kind.SEQUENCE if is_flat(node):
                self.sequence(node, f"{of}.")
            case kind if kind in STRUCTS:
                self.call(f"{node.c_name}_write(w, at, &{of})")
            case Kind.OPEN:
                raise ValueError("an open type outside of a SEQUENCE")
            case _:
                self.call(f"captain_encode_string(w, at, &{node.c_name}_type, &{of})")

    def number(self, width: int, bits: str) -> None:
        if width <= RUN_MAX:
            self.add(width, bits)
        else:
            self.step(f"captain_put_long(w, at, {bits}, {width})")

    def integer(self, node: Node, of: str) -> None:
        low, high, width = node.bounds.low, node.bounds.high, node.bounds.width
        if node.is_extensible:
            self.flush()
            wrong = " || ".join(outside(node, of))
            with self.block(f"if ({wrong or '0'})"):
                self.step("captain_put(w, at, 1, 1)")
                self.step(f"captain_put_unconstrained(w, at, {of})")
            with self.block("else"):
                self.add(1, "0")
                self.root_integer(node, of)
                self.flush()
        elif width is None or low is None or high is None:
            for wrong in outside(node, of):
                self.refuse_if(wrong, "CAPTAIN_RANGE")
            self.root_integer(node, of)
        elif width == 0:
            self.refuse_if(f"{of} != {literal(low)}", "CAPTAIN_RANGE")
        else:
            if low == 0 and high == (1 << 8 * number_octets(node)[0]) - 1:
                self.number(width, f"(uint64_t){of}")
                return
            bits = self.offset(low, of)
            if high - low < (1 << 64) - 1:
                self.refuse_if(f"{bits} > {unsigned(high - low)}", "CAPTAIN_RANGE")
            self.number(width, bits)

    def offset(self, low: int, of: str) -> str:
        """Write a variable with the number minus its lower bound. A smaller number wraps around to a very large one."""
        if low == 0:
            return self.temporary(f"(uint64_t){of}")
        return self.temporary(f"(uint64_t){of} {'-' if low > 0 else '+'} {unsigned(abs(low))}")

    def root_integer(self, node: Node, of: str) -> None:
        low, width = node.bounds.low, node.bounds.width
        if width is not None and low is not None:
            self.number(width, self.offset(low, of))
        elif low is not None:
            self.step(f"captain_put_semi(w, at, {literal(low)}, {of})")
        else:
            self.step(f"captain_put_unconstrained(w, at, {of})")

    def enumerated(self, node: Node, of: str) -> None:
        width, first = (node.root_count - 1).bit_length(), contiguous(node)
        if first is None:
            bits = self.temporary(f"(uint64_t)(int64_t)captain_item_index(&{node.c_name}_type, {of})")
        else:
            bits = self.temporary(f"(uint64_t)(int64_t){of}{f' - (uint64_t)INT64_C({first})' if first else ''}")
        if not node.is_extensible:
            self.refuse_if(f"{bits} >= {node.root_count}", "CAPTAIN_ALTERNATIVE")
            self.add(width, bits)
            return
        self.flush()
        with self.block(f"if ({bits} >= {node.root_count})"):
            self.step("captain_put(w, at, 1, 1)")
            self.call(f"captain_encode_item(w, at, &{node.c_name}_type, {of})")
        with self.block("else"):
            self.step(f"captain_put(w, at, {bits}, {1 + width})")


def outside(node: Node, of: str) -> list[str]:
    """Return C conditions for a number outside the root, without those that are impossible in its C type."""
    octets, is_signed = number_octets(node)
    least, most = (-(1 << 8 * octets - 1), (1 << 8 * octets - 1) - 1) if is_signed else (0, (1 << 8 * octets) - 1)
    low, high = node.bounds.low, node.bounds.high
    found = [f"{of} < {literal(low)}"] if low is not None and low > least else []
    return found + ([f"{of} > {literal(high)}"] if high is not None and high < most else [])
