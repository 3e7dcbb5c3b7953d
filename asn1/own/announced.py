"""ITS PDU header of a user-defined message: checks octets 0 and 1."""

from collections.abc import Iterator

from asn1.layout.nodes import Kind, Node

# ETSI TS 102 894-2, ItsPduHeader: it begins with two numbers of 8 bits each.
HEADER = ("protocolversion", "messageid")


def obstacle(pdu: Node) -> str | None:
    """Return why octets 0 and 1 are not protocolVersion and messageID; None if they are."""
    leading = _leading(pdu, pdu.asn_name or pdu.c_name)
    for wanted in HEADER:
        name, reason = next(leading, ("", "it ends before"))
        if reason or name.lower() != wanted:
            return reason or f"{name} is there"
    return None


def _leading(node: Node, name: str) -> Iterator[tuple[str, str]]:
    """Yield the leading 8-bit numbers of the encoding as (name, ""), then (name, reason) for the first other part."""
    match node.kind:
        case Kind.SEQUENCE if node.is_extensible:
            yield name, f"{name} begins with an extension bit"
        case Kind.SEQUENCE if any(f.is_optional for f in node.root):
            yield name, f"{name} begins with a bit for each OPTIONAL or DEFAULT component"
        case Kind.SEQUENCE:
            for f in node.fields:
                yield from _leading(f.node, f.name)
        case Kind.INTEGER if (node.bounds.low, node.bounds.high, node.is_extensible) == (0, 255, False):
            yield name, ""
        case _:
            yield name, f"{name} is there"
