"""Form -ext of a message, in which extension markers survive serial constraints.

By X.680 50.11 a constraint loses its marker if another one follows (constraints.py). Some peers keep it, and send one
more extension bit. For them a message has an -ext form, with a copy of each type that contains such a constraint. Both
forms have the same memory layout and share one C struct; tables and functions are separate.
"""

from collections.abc import Iterable
from dataclasses import replace

from asn1.layout.nodes import Kind, Node, type_name
from asn1.model.constraints import Bounds


class Forms:
    """Creates the nodes of -ext forms from those of a finished layout.

    made   nodes of all forms.
    taken  C names in use; the names of the forms are added.
    """

    def __init__(self, nodes: Iterable[Node], taken: set[str]) -> None:
        self.made: list[Node] = []
        self._taken = taken
        self._touched = touched(nodes)
        self._known: dict[Node, Node] = {}

    def of(self, node: Node) -> Node:
        """Return the -ext form of a type; the type itself if no serial constraint removes a marker inside it."""
        if node not in self._touched:
            return node
        if node not in self._known:
            self._known[node] = made = replace(node, c_name=self._free(node.c_name), form_of=node)
            self.made.append(made)
            self._fill(made, node)
        return self._known[node]

    def _fill(self, made: Node, node: Node) -> None:
        if _loses_marker(node):
            made.bounds = Bounds(node.bounds.low, node.bounds.high, is_extensible=True)
            made.is_extensible = True
        made.fields = [replace(f, node=self.of(f.node)) for f in node.fields]
        made.element = self.of(node.element) if node.element is not None else None
        made.rows = [(number, self.of(row)) for number, row in node.rows]

    def _free(self, c_name: str) -> str:
        name = type_name(f"{c_name}_ext")
        while name in self._taken:
            name += "_"
        self._taken.add(name)
        return name


def touched(nodes: Iterable[Node]) -> set[Node]:
    """Return the types in which a serial constraint removes an extension marker, and all types that contain one."""
    holders: dict[Node, list[Node]] = {}
    waiting: list[Node] = []
    for node in nodes:
        waiting += [node] if _loses_marker(node) else []
        for child in node.children():
            holders.setdefault(child, []).append(node)
    found: set[Node] = set()
    while waiting:
        node = waiting.pop()
        if node not in found:
            found.add(node)
            waiting += holders.get(node, [])
    return found


def _loses_marker(node: Node) -> bool:
    """Return whether a marker is removed. The size of a UTF8String does not count: PER ignores it (X.691 10.3.6)."""
    return node.bounds.lost_marker and node.kind is not Kind.UTF8
