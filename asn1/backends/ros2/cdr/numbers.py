"""Ranges of numbers in ROS fields and in C structs, and the checks between them."""

from asn1.backends.c.names import literal
from asn1.backends.ros2.cdr.shapes import SIZES
from asn1.backends.ros2.model import RosField
from asn1.layout.memory import number_octets
from asn1.layout.nodes import Field, Kind, Node


def limits(ros_type: str) -> tuple[int, int]:
    """Return least and greatest value of an integer type of ROS."""
    bits = 8 * SIZES[ros_type]
    if ros_type.startswith("uint") or ros_type == "bool":
        return 0, (1 << bits) - 1
    return -(1 << bits - 1), (1 << bits - 1) - 1


def memory_limits(node: Node) -> tuple[int, int]:
    """Return least and greatest value of a number in its C struct."""
    if node.kind is Kind.ENUMERATED:
        return -(1 << 31), (1 << 31) - 1
    octets, is_signed = number_octets(node)
    return limits(f"{'' if is_signed else 'u'}int{8 * octets}")


def unknown(ros_type: str) -> int:
    """Return the number that represents an unknown item or alternative. It exceeds the numbers of all standards."""
    low, high = limits(ros_type)
    return -1 if low < 0 else high


def outside(ros_type: str, node: Node, of: str) -> str:
    """Return the C condition that a field's number is outside the root; "" if it never is."""
    low, high = limits(ros_type)
    wrong = []
    if node.bounds.low is not None and node.bounds.low > low:
        wrong.append(f"{of} < {literal(node.bounds.low)}")
    if node.bounds.high is not None and node.bounds.high < high:
        wrong.append(f"{of} > {literal(node.bounds.high)}")
    return " || ".join(wrong)


def numbers_of(field: RosField, alternatives: list[Field]) -> list[int | None]:
    """Return the number of each alternative of a CHOICE; None if the message has none for it."""
    by_name = {name: number for number, name in field.options}
    return [by_name.get(one.name) for one in alternatives]


def first_of(numbers: list[int | None]) -> int | None:
    """Return the first number if they are consecutive; else None."""
    first = numbers[0] if numbers else None
    if first is None or numbers != list(range(first, first + len(numbers))):
        return None
    return first
