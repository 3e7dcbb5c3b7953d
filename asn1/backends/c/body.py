"""Body of a C function: collects its lines while it is generated."""

import re
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager

from asn1.layout.nodes import Kind, Node

# A 64-bit load or store handles this many bits at any bit offset: 64 less up to 7 bits before the first one.
RUN_MAX = 57


class Body(ABC):
    """Code of a C function: lines with indentation, labels and unique names."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.depth = 1
        self.names = 0
        self.exits: dict[str, str] = {}

    @abstractmethod
    def sequence(self, node: Node, place: str, /) -> None:
        """Write code for the components of a SEQUENCE. place: prefix of their names, "v->" or "v->heading."."""

    @abstractmethod
    def choice(self, node: Node, /) -> None:
        """Write code for the alternatives of the CHOICE at v."""

    @abstractmethod
    def list_(self, node: Node, /) -> None:
        """Write code for the elements of the list at v."""

    @abstractmethod
    def value(self, node: Node, place: str, /) -> None:
        """Write code for a value of any type. place: its C expression."""

    def whole(self, node: Node, content: str) -> None:
        """Write code for the value at v. content: C expression of this value."""
        match node.kind:
            case Kind.SEQUENCE:
                self.sequence(node, "v->")
            case Kind.CHOICE:
                self.choice(node)
            case Kind.LIST:
                self.list_(node)
            case _:
                self.value(node, "v" if node.kind is Kind.FIXED_OCTETS else content)

    def put(self, *lines: str) -> None:
        self.lines += [f"{'    ' * self.depth}{line}" for line in lines]

    def exit(self, status: str) -> str:
        """Return the label at which the function fails with this status. Each status has one label."""
        return self.exits.setdefault(status, status.removeprefix("CAPTAIN_").lower())

    def name(self, stem: str) -> str:
        self.names += 1
        return f"{stem}{self.names}"

    @contextmanager
    def block(self, head: str = "", tail: str = "") -> Iterator[None]:
        """Write `head {` ... `}` around the lines of the context. tail "else" continues after the closing brace."""
        self.put(f"{head} {{".lstrip())
        self.depth += 1
        yield
        self.depth -= 1
        self.put(f"}}{tail}")

    def uses(self, word: str) -> bool:
        """Return whether a line after the first contains the word. The first line declares v."""
        pattern = re.compile(rf"(?<![\w>.]){word}\b")
        return any(pattern.search(line) for line in self.lines[1:])


def counted(function: str, parameters: str, failure: str) -> list[str]:
    """Return a wrapper of <function>_inside that limits the recursion of a type that contains itself.

    parameters  "captain_reader *r, size_t at, void *to": state with the depth, offset, value.
    failure     return value beyond the limit. After a failure decoding ends, so that the depth is not decremented.
    """
    state, at, value = (one.split()[-1].lstrip("*") for one in parameters.split(","))
    return [
        f"size_t {function}({parameters})",
        "{",
        f"    if (++{state}->depth > CAPTAIN_MAX_RECURSION)",
        f"        return {failure};",
        f"    {at} = {function}_inside({state}, {at}, {value});",
        f"    {state}->depth--;",
        f"    return {at};",
        "}",
        "",
    ]
