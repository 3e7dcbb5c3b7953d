"""The -ext form of a message: an extension marker stays through serial constraints.

X.680 50.11 takes the marker of a constraint that another one follows (constraints.py). Peers that keep it send one
more extension bit. For them a message has an -ext form: the types of its PDU again, as far as such a constraint is in
them. Memory is the same in both forms, so that both have one C struct; tables and functions are their own.
"""

from collections.abc import Iterable
from dataclasses import replace

from asn1.constraints import Bounds
from asn1.nodes import Kind, Node, type_name


class Forms:
    """Makes the nodes of -ext forms from those of a finished layout.

    made   the nodes of all forms.
    taken  C names that are in use; those of the forms are added.
    """

    def __init__(self, nodes: Iterable[Node], taken: set[str]) -> None:
        self.made: list[Node] = []
        self._taken = taken
        self._touched = touched(nodes)
        self._known: dict[Node, Node] = {}

    def of(self, node: Node) -> Node:
        """Return the -ext form of a type; the type itself if no serial constraint takes a marker in it."""
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
    """The types that a serial constraint takes a marker from, and all that hold one."""
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
    """PER does not see the size of a UTF8String (X.691 10.3.6)."""
    return node.bounds.lost_marker and node.kind is not Kind.UTF8
