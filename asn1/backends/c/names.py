"""Names and number literals in C."""

from asn1.layout.memory import number_octets
from asn1.layout.nodes import STRUCTS, Field, Kind, Node
from asn1.layout.widths import is_flat

# Keywords of C11 and C++20, and members that every extensible struct has.
_TAKEN = frozenset(
    (
        "alignas", "alignof", "and", "and_eq", "asm", "auto", "bitand", "bitor", "bool", "break", "case", "catch",
        "char", "char8_t", "char16_t", "char32_t", "class", "compl", "concept", "const", "consteval", "constexpr",
        "constinit", "const_cast", "continue", "co_await", "co_return", "co_yield", "decltype", "default", "delete",
        "do", "double", "dynamic_cast", "else", "enum", "explicit", "export", "extern", "false", "float", "for",
        "friend", "goto", "if", "inline", "int", "long", "mutable", "namespace", "new", "noexcept", "not", "not_eq",
        "nullptr", "operator", "or", "or_eq", "private", "protected", "public", "register", "reinterpret_cast",
        "requires", "restrict", "return", "short", "signed", "sizeof", "static", "static_assert", "static_cast",
        "struct", "switch", "template", "this", "thread_local", "throw", "true", "try", "typedef", "typeid",
        "typename", "union", "unsigned", "using", "virtual", "void", "volatile", "wchar_t", "while", "xor", "xor_eq",
        "additions", "unknown",
    )
)  # fmt: skip

_STRINGS = {Kind.BIT_STRING: "captain_bits", Kind.OCTET_STRING: "captain_octets", Kind.OID: "captain_octets",
            Kind.RELATIVE_OID: "captain_octets", Kind.OPEN: "captain_open"}  # fmt: skip


def member(name: str) -> str:
    """Return a component's name as struct member. It never equals has_<member>, the flag of an optional component."""
    name = name.replace("-", "_")
    is_flag = name.startswith("has_") and member(name[4:]) == name[4:]
    return f"{name}_" if is_flag or name in _TAKEN else name


def value_type(node: Node) -> str:
    """Return the C type of a value. Arrays of octets need `declaration` instead."""
    match node.kind:
        case Kind.BOOLEAN | Kind.NULL:
            return "bool"
        case Kind.INTEGER | Kind.SMALL_BITS:
            octets, is_signed = number_octets(node)
            return f"{'' if is_signed else 'u'}int{8 * octets}_t"
        case Kind.ENUMERATED:
            return "int32_t"
        case Kind.FIXED_OCTETS:
            return "uint8_t"
        case kind if kind in STRUCTS:
            return node.struct_name
        case kind:
            return _STRINGS.get(kind, "captain_text")


def declaration(node: Node, name: str, is_pointer: bool = False) -> str:
    """Return the declaration of a variable or member for a value, or for a pointer to one."""
    tag = "struct " if node.kind in STRUCTS and is_pointer else ""
    if node.kind is Kind.FIXED_OCTETS:
        return f"uint8_t {f'(*{name})' if is_pointer else name}[{node.size}]"
    return f"{tag}{value_type(node)} {'*' if is_pointer else ''}{name}"


def field_declaration(f: Field) -> str:
    return declaration(f.node, member(f.name), f.is_pointer)


def literal(number: int) -> str:
    """Return a C constant of a type that can hold the number."""
    if -(1 << 31) < number < 1 << 31:
        return str(number)
    if number == -(1 << 63):
        return "INT64_MIN"
    if number >= 1 << 63:
        return f"UINT64_C({number})"
    return f"INT64_C({number})"


def unsigned(number: int) -> str:
    return f"{number}u" if number < 1 << 32 else f"UINT64_C({number})"


def needs_functions(node: Node) -> bool:
    """Return whether a type has functions to decode and encode it. Those of others belong to the enclosing struct."""
    return node.is_entry or (node.kind in STRUCTS and not is_flat(node))


def has_check(node: Node) -> bool:
    """Return whether a function validates the type."""
    return node.is_entry or node.kind in STRUCTS


def has_public_table(node: Node) -> bool:
    """Return whether the table is public. Other tables are reached through fields, or captain_find_message()."""
    return node.form_of is None and (node.kind in STRUCTS or node.is_entry)


def contiguous(node: Node) -> int | None:
    """Return the number of an ENUMERATED's first item if its items are consecutive in encoding order; else None."""
    numbers = [name.value for name in node.names]
    return numbers[0] if numbers == list(range(numbers[0], numbers[0] + len(numbers))) else None
