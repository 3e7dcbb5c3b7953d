"""Readers of numbers from CDR; they check ranges, items and alternatives."""

from asn1.backends.c.names import contiguous, literal, member, value_type
from asn1.backends.ros2.cdr.numbers import first_of, limits, memory_limits, numbers_of, outside, unknown
from asn1.backends.ros2.cdr.places import Place, dot
from asn1.backends.ros2.cdr.reading import Reading, behind
from asn1.backends.ros2.cdr.shapes import SIZES
from asn1.backends.ros2.model import RosField
from asn1.layout.nodes import Kind, Node


def number(to: Reading, one: RosField, node: Node, place: str, name: str) -> None:
    size = SIZES[one.type]
    to.put(f"at = {behind('at', size)};")
    to.fail_if("CAPTAIN_UNLIKELY(at > r->size)", f'captain_cdr_cut(r, at - {size}, "{name}")')
    if node.kind is Kind.BOOLEAN:
        to.bool_at("at - 1", place, name)
        return
    if node.kind is Kind.NULL:
        to.put(f"{place} = false;")
        return
    if node.kind is Kind.BIT_STRING:
        to.call(f'captain_cdr_number_bits(r, at, &{place}, &{node.c_name}_type, "{name}")')
        return
    with to.block():
        to.put(f"const {_c_type(one.type)} x = ({_c_type(one.type)})captain_cdr_load(r, at, {size});")
        if node.kind is Kind.ENUMERATED:
            _item(to, one, node, place, name)
            return
        if node.kind is Kind.SMALL_BITS:
            if node.size < 64:
                bad = f'captain_cdr_bad_bits(r, at - {size}, x, &{node.c_name}_type, "{name}")'
                to.fail_if(f"(uint64_t)x >> {node.size} != 0", bad)
            to.put(f"{place} = ({value_type(node)})captain_cdr_turn((uint64_t)x, {node.size});")
            return
        wrong = outside(one.type, node, "x") if not node.is_extensible else ""
        if wrong:
            bad = f'captain_cdr_bad_number(r, at - {size}, (int64_t)x, &{node.c_name}_type, "{name}")'
            to.fail_if(wrong, bad)
        to.put(f"{place} = ({value_type(node)})x;")


def choice(to: Reading, one: RosField, end: Place, name: str) -> None:
    size, numbers = SIZES[one.type], numbers_of(one, end.node.fields)
    chosen, first = f"{dot(end.place)}choice", first_of(numbers)
    to.put(f"at = {behind('at', size)};")
    to.fail_if("CAPTAIN_UNLIKELY(at > r->size)", f'captain_cdr_cut(r, at - {size}, "{name}")')
    with to.block():
        to.put(f"const int64_t x = ({_c_type(one.type)})captain_cdr_load(r, at, {size});")
        if first is not None:
            to.put(f"{chosen} = x >= {first} && x < {first + len(numbers)} ? (uint32_t)(x - {first}) + 1 : 0;")
        else:
            to.put("switch (x) {")
            for k, number in enumerate(numbers, 1):
                if number is not None:
                    to.put(f"case {number}: {chosen} = {k}; break;")
            to.put(f"default: {chosen} = 0;", "}")
        with to.block(f"if (CAPTAIN_UNLIKELY({chosen} == 0))"):
            bad = f'captain_cdr_bad_choice(r, at - {size}, x, "{name}")'
            is_kept = end.node.is_extensible or None in numbers
            wrong = f"!r->takes_unknown || x != {literal(unknown(one.type))}" if is_kept else "true"
            to.fail_if(wrong, bad)
            if end.node.is_extensible:
                to.put(f"{chosen} = CAPTAIN_UNKNOWN;", f"{dot(end.place)}u.unknown = (captain_octets){{.count = 0}};")
    for k, f in enumerate(end.node.fields, 1):
        if f.node.kind is Kind.NULL and not f.is_pointer:
            to.put(f"if ({chosen} == {k})", f"    {dot(end.place)}u.{member(f.name)} = false;")


def _item(to: Reading, one: RosField, node: Node, place: str, name: str) -> None:
    low, high = limits(one.type)
    first, size = contiguous(node), SIZES[one.type]
    bad = f'captain_cdr_bad_item(r, at - {size}, (int64_t)x, &{node.c_name}_type, "{name}")'
    if node.is_extensible:
        to.put(f"if (CAPTAIN_UNLIKELY(r->takes_unknown && x == {literal(unknown(one.type))}))")
        to.put(f"    {place} = CAPTAIN_UNKNOWN;", "else")
    with to.block():
        if first is None:
            least, most = memory_limits(node)
            wide = [f"x < {literal(least)}"] if low < least else []
            wide += [f"x > {literal(most)}"] if high > most else []
            to.fail_if(" || ".join([*wide, f"captain_item_index(&{node.c_name}_type, (int32_t)x) < 0"]), bad)
        else:
            last = first + len(node.names) - 1
            wrong = [f"x < {first}"] if low < first else []
            wrong += [f"x > {last}"] if high > last else []
            if wrong:
                to.fail_if(" || ".join(wrong), bad)
        to.put(f"{place} = (int32_t)x;")


def _c_type(ros_type: str) -> str:
    return "uint8_t" if ros_type == "bool" else f"{ros_type}_t"
