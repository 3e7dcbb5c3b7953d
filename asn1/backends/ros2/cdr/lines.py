"""C functions of CDR: collects their lines and the list of required functions."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from asn1.backends.ros2.cdr.shapes import SIZES, Shapes
from asn1.backends.ros2.model import RosField
from asn1.layout.nodes import Node


def shape_name(message: str) -> str:
    """Return the C name of a message's captain_cdr_shape."""
    return f"{message}_shape"


def part_text(shapes: Shapes, field: RosField, name: str) -> str:
    """Return the C initialiser of a captain_cdr_part. A message with a single field is replaced by that field."""
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
    """Code of one C function: lines with indentation, and unique names."""

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
        """Declare a captain_cdr_part and return its name. name: path in errors, if it differs from the field's name."""
        made = self.name("part")
        self.put(f"static const captain_cdr_part {made} = {part_text(self.shapes, of, name or of.name)};")
        return made

    @contextmanager
    def block(self, head: str = "") -> Iterator[None]:
        """Write `head {` ... `}` around the lines of the context.

        An `else` joins the closing brace of the previous block.
        """
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
    """Functions of one package: one for each message with each type of the layout that it represents.

    waiting  requested pairs whose functions are not yet written
    lists    element types that reading allocates, each with the fewest octets of an element
    takes    the same for types behind pointers
    """

    shapes: Shapes
    names: dict[tuple[str, Node], str] = field(default_factory=dict)
    waiting: list[tuple[str, Node]] = field(default_factory=list)
    lists: list[tuple[Node, int]] = field(default_factory=list)
    takes: list[tuple[Node, int]] = field(default_factory=list)

    def of(self, message: str, node: Node) -> str:
        """Return the stem of the names of a pair's functions, and request them."""
        key = (message, node)
        if key not in self.names:
            taken = sum(one == message for one, _ in self.names)
            self.names[key] = f"{message}_{taken + 1}" if taken else message
            self.waiting.append(key)
        return self.names[key]
