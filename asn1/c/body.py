"""The inside of a C function while it is written."""

import re
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager

from asn1.nodes import Kind, Node

# One load gives this many bits wherever they begin in an octet, and one store takes as many.
RUN_MAX = 57


class Body(ABC):
    """Lines with their indentation, and names that are free."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.depth = 1
        self.names = 0
        self.exits: dict[str, str] = {}

    @abstractmethod
    def sequence(self, node: Node, place: str, /) -> None:
        """The components of a SEQUENCE; place: what stands before their names, "v->" or "v->heading."."""

    @abstractmethod
    def choice(self, node: Node, /) -> None:
        """The alternatives of the CHOICE that v points to."""

    @abstractmethod
    def list_(self, node: Node, /) -> None:
        """The elements of the list that v points to."""

    @abstractmethod
    def value(self, node: Node, place: str, /) -> None:
        """A value of any type at a place."""

    def whole(self, node: Node, content: str) -> None:
        """The value that v points to; content: how the function spells what v points to."""
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
        """The label of the one place in the function that fails with this status."""
        return self.exits.setdefault(status, status.removeprefix("CAPTAIN_").lower())

    def name(self, stem: str) -> str:
        self.names += 1
        return f"{stem}{self.names}"

    @contextmanager
    def block(self, head: str = "", tail: str = "") -> Iterator[None]:
        """`head {` ... `}`; tail "else" goes on behind the brace of the block before it."""
        self.put(f"{head} {{".lstrip())
        self.depth += 1
        yield
        self.depth -= 1
        self.put(f"}}{tail}")

    def uses(self, word: str) -> bool:
        """Behind its first line, which declares what the function is about."""
        pattern = re.compile(rf"(?<![\w>.]){word}\b")
        return any(pattern.search(line) for line in self.lines[1:])


def counted(function: str, parameters: str, failure: str) -> list[str]:
    """A function around <function>_inside, for what contains itself: it counts how often, whichever way that is left.

    parameters  "captain_reader *r, size_t at, void *to": the state that holds the depth, the offset, the value.
    failure     what it returns once that is too often; nothing goes on behind a failure, so the depth may stay.
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
