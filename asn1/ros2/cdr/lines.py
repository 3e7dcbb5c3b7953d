"""C functions while they are written, and which of them there are to be."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from asn1.nodes import Node
from asn1.ros2.cdr.shapes import SIZES, Shapes
from asn1.ros2.model import RosField


def shape_name(message: str) -> str:
    """C of the captain_cdr_shape of a message."""
    return f"{message}_shape"


def part_text(shapes: Shapes, field: RosField, name: str) -> str:
    """C of a captain_cdr_part. A message of one field is that field."""
    sole = shapes.sole(field)
    shape = "NULL"
    if sole.type in SIZES:
        kind = f"CAPTAIN_CDR_{SIZES[sole.type]}"
    elif sole.type == "string":
        kind = "CAPTAIN_CDR_STRING"
    else:
        kind, shape = "CAPTAIN_CDR_MESSAGE", f"&{shape_name(sole.type)}"
    return f'{{"{name}", {shape}, {kind}, {"true" if sole.is_array else "false"}}}'


class Lines:
    """Of one function, with their indentation; names that are free in it."""

    def __init__(self, functions: "Functions") -> None:
        self.functions = functions
        self.shapes = functions.shapes
        self.lines: list[str] = []
        self.depth = 1
        self.names = 0

    def put(self, *lines: str) -> None:
        self.lines += [f"{'    ' * self.depth}{line}" for line in lines]

    def name(self, stem: str) -> str:
        self.names += 1
        return f"{stem}{self.names}"

    def uses(self, word: str) -> bool:
        pattern = re.compile(rf"(?<![\w>.]){word}\b")
        return any(pattern.search(line) for line in self.lines)

    def part(self, of: RosField, name: str = "") -> str:
        """A captain_cdr_part of a field, declared here; name: in errors, where it is not that of the field alone."""
        made = self.name("part")
        self.put(f"static const captain_cdr_part {made} = {part_text(self.shapes, of, name or of.name)};")
        return made

    @contextmanager
    def block(self, head: str = "") -> Iterator[None]:
        """`head {` ... `}`; directly behind a block, `else` stands on the line of its brace."""
        if head.startswith("else") and self.lines and self.lines[-1].strip() == "}":
            self.lines.pop()
            head = f"}} {head}"
        self.put(f"{head} {{".lstrip())
        self.depth += 1
        yield
        self.depth -= 1
        self.put("}")


@dataclass
class Functions:
    """Those of one package: one for each message and each type of the layout that it stands for.

    waiting       pairs that have been asked for, and not yet written
    lists, takes  types that reading takes memory for, in lists and behind pointers, with the fewest octets that say so
    """

    shapes: Shapes
    names: dict[tuple[str, Node], str] = field(default_factory=dict)
    waiting: list[tuple[str, Node]] = field(default_factory=list)
    lists: list[tuple[Node, int]] = field(default_factory=list)
    takes: list[tuple[Node, int]] = field(default_factory=list)

    def of(self, message: str, node: Node) -> str:
        """The stem of the names of a pair's functions."""
        key = (message, node)
        if key not in self.names:
            taken = sum(one == message for one, _ in self.names)
            self.names[key] = f"{message}_{taken + 1}" if taken else message
            self.waiting.append(key)
        return self.names[key]
