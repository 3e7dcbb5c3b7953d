"""Validators in C: generates a function per struct that checks every constraint.

That includes constraints that PER ignores.
"""

from asn1.backends.c.body import Body
from asn1.backends.c.names import contiguous, literal, member, value_type
from asn1.backends.c.predicate import Predicates
from asn1.backends.c.write_values import outside
from asn1.layout.memory import number_octets
from asn1.layout.nodes import STRUCTS, Field, Kind, Node
from asn1.layout.widths import EMPTY_MAX, is_endless
from asn1.model.types import Constraint


def validator(node: Node, predicates: Predicates) -> list[str]:
    """Return the validating function. Functions that it needs are added to `predicates`."""
    body = _Validator(predicates)
    body.put(f"const {value_type(node)} *v = from;")
    body.whole(node, "(*v)")
    if node.kind in (Kind.SEQUENCE, Kind.CHOICE, Kind.LIST):
        body.constraints(node, node.constraints, "(*v)")
    lines = body.lines if body.uses("v") else [*body.lines, "    (void)v;"]
    head = f"captain_status {node.c_name}_check(const void *from)"
    return [head, "{", *lines, "    return CAPTAIN_OK;", "}", ""]


def is_free(node: Node, known: dict[Node, bool]) -> bool:
    """Return whether every value in memory is valid, so that no check is needed."""
    if node not in known:
        known[node] = True  # ends the recursion of a type inside itself
        known[node] = _is_free(node, known)
    return known[node]


def _is_free(node: Node, known: dict[Node, bool]) -> bool:
    match node.kind:
        case Kind.BOOLEAN | Kind.NULL | Kind.FIXED_OCTETS:
            return True
        case Kind.INTEGER:
            return not out_of_range(node, "x") and not node.bounds.gaps
        case Kind.SMALL_BITS:
            return node.size == 8 * number_octets(node)[0]
        case _:
            return False


def out_of_range(node: Node, of: str) -> list[str]:
    """Return conditions for an invalid number; none with an extension marker, because later editions may allow it."""
    return [] if node.is_extensible else outside(node, of)


class _Validator(Body):
    def __init__(self, predicates: Predicates) -> None:
        super().__init__()
        self.predicates = predicates

    def fail_if(self, condition: str, status: str) -> None:
        self.put(f"if ({condition})", f"    return {status};")

    def call(self, expression: str) -> None:
        with self.block():
            self.put(f"const captain_status status = {expression};", "if (status != CAPTAIN_OK)", "    return status;")

    def constraints(self, node: Node, constraints: tuple[Constraint, ...], of: str) -> None:
        for constraint in constraints:
            condition = self.predicates.inner(constraint, node, of)
            if condition is not None:
                self.fail_if(f"!({condition})", "CAPTAIN_INNER")

    def value(self, node: Node, of: str) -> None:
        match node.kind:
            case Kind.BOOLEAN | Kind.NULL | Kind.FIXED_OCTETS:
                pass
            case Kind.INTEGER:
                self.integer(node, of)
            case Kind.SMALL_BITS:
                if not is_free(node, {}):
                    self.fail_if(f"{of} >> {node.size} != 0", "CAPTAIN_SIZE")
            case Kind.ENUMERATED:
                self.enumerated(node, of)
            case kind if kind in STRUCTS:
                if not is_free(node, self.predicates.free):
                    self.call(f"{node.c_name}_check(&{of})")
            case Kind.OPEN:
                raise ValueError("an open type outside of a SEQUENCE")
            case _:
                self.call(f"captain_validate_string(&{node.c_name}_type, &{of})")

    def integer(self, node: Node, of: str) -> None:
        wrong = out_of_range(node, of)
        if wrong:
            self.fail_if(" || ".join(wrong), "CAPTAIN_RANGE")
        for low, high in node.bounds.gaps:
            if low is not None and high is not None:
                gap = f"{of} == {literal(low)}" if low == high else f"{of} >= {literal(low)} && {of} <= {literal(high)}"
                self.fail_if(gap, "CAPTAIN_INNER")

    def enumerated(self, node: Node, of: str) -> None:
        first = contiguous(node)
        unknown = f" && {of} < CAPTAIN_UNKNOWN" if node.is_extensible else ""
        if first is None:
            self.fail_if(f"captain_item_index(&{node.c_name}_type, {of}) < 0{unknown}", "CAPTAIN_ALTERNATIVE")
        else:
            outside = f"({of} < {first} || {of} > {first + len(node.names) - 1})"
            self.fail_if(f"{outside}{unknown}", "CAPTAIN_ALTERNATIVE")
        self.constraints(node, node.constraints, of)

    def sequence(self, node: Node, of: str) -> None:
        for f in node.fields:
            name = f"{of}{member(f.name)}"
            if not f.is_optional:
                self.component(node, f, name, of)
            elif not is_free(f.node, self.predicates.free) or f.checks:
                with self.block(f"if ({of}has_{member(f.name)})"):
                    self.component(node, f, name, of)
        for group in node.groups():
            self.group(group, of)

    def group(self, group: list[Field], of: str) -> None:
        """Write code that checks a group of additions: its mandatory components are present together (X.691 19.9)."""
        missing = [f"!{of}has_{member(f.name)}" for f in group if f.is_mandatory]
        if missing and len(group) > 1:
            there = " || ".join(f"{of}has_{member(f.name)}" for f in group)
            self.fail_if(f"({there}) && ({' || '.join(missing)})", "CAPTAIN_PRESENCE")

    def component(self, node: Node, f: Field, name: str, of: str) -> None:
        value = f"(*{name})" if f.is_pointer else name
        if f.node.kind is Kind.OPEN:
            selector = f"{of}{member(node.fields[f.node.selector].name)}"
            self.call(f"captain_validate_open(&{f.node.c_name}_type, (int64_t){selector}, &{name})")
        elif f.is_pointer:
            self.fail_if(f"{name} == NULL", "CAPTAIN_PRESENCE")
            self.call(f"{f.node.c_name}_check({name})")
        else:
            self.value(f.node, name)
        self.constraints(f.node, f.checks, value)

    def choice(self, node: Node) -> None:
        with self.block("switch (v->choice)"):
            for k, f in enumerate(node.fields, 1):
                with self.block(f"case {k}:"):
                    self.component(node, f, f"v->u.{member(f.name)}", "v->u.")
                    self.put("break;")
            with self.block("default:"):
                if node.is_extensible:
                    self.fail_if("v->choice < CAPTAIN_UNKNOWN", "CAPTAIN_ALTERNATIVE")
                    self.put("break;")
                else:
                    self.put("return CAPTAIN_ALTERNATIVE;")

    def list_(self, node: Node) -> None:
        low, high = node.bounds.low or 0, node.bounds.high
        if is_endless(node):
            self.fail_if(f"v->count > {EMPTY_MAX}", "CAPTAIN_SIZE")
        if not node.is_extensible:
            wrong = ([f"v->count < {low}"] if low else []) + ([] if high is None else [f"v->count > {high}"])
            if wrong:
                self.fail_if(" || ".join(wrong), "CAPTAIN_SIZE")
            for first, last in node.bounds.gaps:
                self.fail_if(f"v->count >= {first} && v->count <= {last}", "CAPTAIN_INNER")
        if is_free(node.item, self.predicates.free) and not node.element_checks:
            return
        with self.block("for (uint32_t i = 0; i < v->count; i++)"):
            self.value(node.item, "v->items[i]")
            self.constraints(node.item, node.element_checks, "v->items[i]")
