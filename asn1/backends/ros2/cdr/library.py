"""C code that converts UPER to serialised ROS 2 messages and back: a source per package.

The message library decodes octets to a C struct. The generated code writes that struct as CDR, field by field in the
order of the .msg, and reads it back. It creates no object per field. Present fields have straight code. Absent fields
use tables, because they are only zeros or skipped.

These files (`src/ros2_*.c`, `captain/ros2.h`) are optional. The message library does not contain them, because many
users have no ROS.
"""

import math
import re
import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path

from asn1.backends.c.tables import text
from asn1.backends.ros2.cdr.lines import Functions, part_text, shape_name
from asn1.backends.ros2.cdr.read import reader
from asn1.backends.ros2.cdr.shapes import Shapes
from asn1.backends.ros2.cdr.write import writer
from asn1.backends.ros2.model import RosPackage
from asn1.layout.layout import Layout, Node
from asn1.layout.memory import measure

RUNTIME = Path(__file__).parents[1] / "runtime"


def write(layout: Layout, packages: Sequence[RosPackage], folder: Path) -> list[Path]:
    """Write the C code of some packages, and the runtime, to a folder with the sources of the messages.

    Returns the generated files. The same model gives the same octets.
    """
    shutil.copytree(RUNTIME / "include", folder / "include", dirs_exist_ok=True)
    shutil.copytree(RUNTIME / "src", folder / "src", dirs_exist_ok=True)
    files = {f"src/ros2_{package.profile}_{package.name}.c": source(layout, package) for package in packages}
    files["src/ros2_messages.c"] = _list(packages)
    for name, content in files.items():
        (folder / name).write_text(content, encoding="utf-8")
    return [folder / name for name in sorted(files)]


def source(layout: Layout, package: RosPackage) -> str:
    """Return the C source of one package."""
    functions = Functions(Shapes(package))
    code: list[str] = []
    tops = [(edition, package.tops[edition], layout.pdus[edition]) for edition in package.tops]
    for _, message, pdu in tops:
        functions.of(message, pdu)
    while functions.waiting:
        message, node = functions.waiting.pop()
        code += [*writer(functions, message, node), *reader(functions, message, node)]
    modules = sorted({node.module for node in _reached([pdu for _, _, pdu in tops])})
    heads = [f"{line};" for line in code if line.startswith("static size_t ")]
    entries = [
        line
        for number, (edition, message, pdu) in enumerate(tops)
        for line in _entry(functions, package, number, edition, message, pdu)
    ]
    return "\n".join(
        [
            f"/* Messages of {package.name}: made by captain-asn1 for the profile {package.profile}. */",
            '#include "cdr.h"',
            *(f'#include "{module}.h"' for module in modules),
            "",
            *_shapes(functions.shapes, code),
            *heads,
            "",
            *code,
            *entries,
        ]
    )


def _entry(
    functions: Functions, package: RosPackage, number: int, edition: str, message: str, pdu: Node
) -> Iterator[str]:
    name = functions.of(message, pdu)
    yield f"CAPTAIN_HIDDEN extern const captain_ros2 {entry_name(package, number)};"
    yield f"const captain_ros2 {entry_name(package, number)} = {{"
    yield f"    .message = {text(edition)}, .profile = {text(package.profile)},"
    yield f"    .type = {text(f'{package.name}/msg/{message}')}, .pdu = &{pdu.c_name}_type,"
    yield f"    .write = {name}_write, .read = {name}_read, .arena = {_arena(functions, pdu)},"
    yield "};"
    yield ""


def entry_name(package: RosPackage, number: int) -> str:
    return f"captain_ros2_{package.profile}_{package.name}_{number}"


def _list(packages: Sequence[RosPackage]) -> str:
    names = sorted((edition, entry_name(one, k)) for one in packages for k, edition in enumerate(one.tops))
    return "\n".join(
        [
            "/* Every message that there is for ROS 2: made by captain-asn1. */",
            "#include <captain/ros2.h>",
            "",
            *(f"extern const captain_ros2 {name};" for _, name in names),
            "",
            "const captain_ros2 *const captain_ros2_messages[] = {",
            *([f"    &{name}," for _, name in names] or ["    NULL,"]),
            "};",
            f"const size_t captain_ros2_messages_count = {len(names)};",
            "",
        ]
    )


# ---------------------------------------------------------------- tables


def _shapes(shapes: Shapes, code: list[str]) -> Iterator[str]:
    """Yield the tables of the shapes that the code refers to, and of the shapes inside them."""
    words = set(re.findall(r"\b(\w+_shape)\b", "\n".join(code)))
    waiting = [one for one in shapes.package.messages if shape_name(one) in words]
    found: dict[str, list[str]] = {}
    while waiting:
        name = waiting.pop()
        if name in found:
            continue
        shape, fields = shape_name(name), shapes.fields(name)
        waiting += [sole.type for sole in map(shapes.sole, fields) if shapes.is_message(sole)]
        found[name] = [
            f"static const captain_cdr_part {shape}_parts[] = {{",
            *(f"    {part_text(shapes, one, one.name)}," for one in fields),
            "};",
            f"static const captain_cdr_shape {shape} = {{",
            f"    {shape}_parts, {len(fields)},",
            f"    {{{', '.join(map(str, shapes.spans(name)))}}}, {{{', '.join(map(str, shapes.spans(name, True)))}}},",
            "};",
        ]
    yield from (f"static const captain_cdr_shape {shape_name(name)};" for name in sorted(found))
    yield ""
    for name in sorted(found):
        yield from found[name]
    yield ""


# ---------------------------------------------------------------- memory


def _arena(functions: Functions, pdu: Node) -> int:
    """Return the most arena octets that reading takes per octet of CDR.

    Each list element is charged to its own octets. So is each struct behind a pointer; but nested ones share their
    octets, so their cost is multiplied by the depth of nesting.
    """
    sizes: dict[Node, tuple[int, int]] = {}
    lists = max(((measure(node, sizes)[0] + 8) / least for node, least in functions.lists), default=0.0)
    takes = max(((measure(node, sizes)[0] + 8) / least for node, least in functions.takes), default=0.0)
    return math.ceil(1 + lists + _pointers(pdu, {}) * takes)


def _pointers(node: Node, known: dict[Node, int]) -> int:
    """Return the greatest depth of nested structs behind pointers and rows of open types, inside a node."""
    if node not in known:
        known[node] = 0
        inside = [_pointers(f.node, known) + f.is_pointer for f in node.fields]
        inside += [_pointers(row, known) + 1 for _, row in node.rows]
        inside += [_pointers(node.element, known)] if node.element is not None else []
        known[node] = max(inside, default=0)
    return known[node]


def _reached(nodes: Sequence[Node]) -> set[Node]:
    found: set[Node] = set()
    waiting = list(nodes)
    while waiting:
        node = waiting.pop()
        if node not in found:
            found.add(node)
            waiting += node.children()
    return found


__all__ = ["RUNTIME", "source", "write"]
