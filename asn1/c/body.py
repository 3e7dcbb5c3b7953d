"""The inside of a C function while it is written."""

import re
from collections.abc import Iterator
from contextlib import contextmanager

# One load gives this many bits wherever they begin in an octet, and one store takes as many.
RUN_MAX = 57


class Body:
    """Lines with their indentation, and names that are free."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.depth = 1
        self.names = 0
        self.exits: dict[str, str] = {}

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
