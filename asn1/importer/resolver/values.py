"""Values: resolves named numbers, value references and defaults."""

from asn1.importer.parser import syntax
from asn1.importer.parser.fault import Place, fault
from asn1.importer.resolver.program import Program, Scope, Typed
from asn1.model.types import Default, Named

_INTEGER = syntax.WithItems(place=Place("", 0), name="INTEGER")
# Highest named bit, so that a DEFAULT cannot fill the memory. The standards have at most 64 bits.
MAX_BIT = 65535
# Type of sizes and of named numbers: INTEGER.
PLAIN_NUMBER = Typed(_INTEGER, Scope(""))


def number(program: Program, value: syntax.Value, scope: Scope, governor: Typed) -> int:
    """Return the number of a value; for an enumeration item its own, for TRUE 1, for FALSE 0.

    Raises ImportFault if the value, or the name or parameter that it refers to, is not a number.
    """
    match value:
        case syntax.Number():
            return value.value
        case syntax.Word():
            with program.step(value.place):
                return _number_of_word(program, value, scope, governor)
    raise fault(value.place, "this is not a number", "X.680 19")


def _number_of_word(program: Program, word: syntax.Word, scope: Scope, governor: Typed) -> int:
    base = program.base(governor)
    if isinstance(base.type, syntax.Plain) and base.type.name == "BOOLEAN" and word.name in {"TRUE", "FALSE"}:
        return int(word.name == "TRUE")
    # Names of the governing type take precedence over value references (X.680 19.10).
    if word.module is None:
        for name, found in names(program, base):
            if name == word.name:
                return found
        if word.name in scope.bound:
            bound = scope.bound[word.name]
            if bound.actual.value is None:
                raise fault(word.place, f"the parameter {word.name} is not a value", "X.683 9.5")
            return number(program, bound.actual.value, bound.scope, governor)
    assigned, inside = _assigned(program, word, scope)
    return number(program, assigned.value, inside, Typed(assigned.type, inside))


def _assigned(program: Program, word: syntax.Word, scope: Scope) -> tuple[syntax.ValueAssignment, Scope]:
    key, assignment = program.find(scope, word.name, word.place, word.module)
    if not isinstance(assignment, syntax.ValueAssignment):
        raise fault(word.place, f"{word.name} is not a value", "X.680 16.2")
    return assignment, Scope(key)


def names(program: Program, base: Typed) -> tuple[Named, ...]:
    """Return the named numbers, bits or enumeration items of a builtin type.

    Raises ImportFault for a bit beyond MAX_BIT, and for a duplicate name or number (X.680 19, 22).
    """
    match base.type:
        case syntax.WithItems(name=name, items=items):
            found = tuple(Named(item.name, _item_number(program, item, base.scope)) for item in items)
            if name == "BIT STRING" and any(not 0 <= one.value <= MAX_BIT for one in found):
                raise fault(base.type.place, f"out of range: bit outside of 0..{MAX_BIT}", "X.680 22.4")
            _distinct(found, name, base.type.place)
            return found
        case syntax.Enumerated():
            return (*root_items(program, base), *addition_items(program, base))
    return ()


def _distinct(found: tuple[Named, ...], name: str, place: Place) -> None:
    """Raise ImportFault for a duplicate name or number."""
    clause = "X.680 22" if name == "BIT STRING" else "X.680 19"
    for what in ({one.name: one for one in found}, {one.value: one for one in found}):
        if len(what) < len(found):
            twice = next(one for one in found if one not in what.values())
            raise fault(place, f"{twice.name}({twice.value}): duplicate name or number", clause)


def _item_number(program: Program, item: syntax.Item, scope: Scope) -> int:
    assert item.value is not None
    return number(program, item.value, scope, PLAIN_NUMBER)


def root_items(program: Program, base: Typed) -> tuple[Named, ...]:
    """Return the root items of an ENUMERATED, ascending. Items without a number get the smallest free ones.

    Raises ImportFault if two have the same name or number. Source: X.680 20.3, 20.4.
    """
    assert isinstance(base.type, syntax.Enumerated)
    given = {_item_number(program, item, base.scope) for item in base.type.root if item.value is not None}
    found: list[Named] = []
    following = 0
    for item in base.type.root:
        if item.value is not None:
            found.append(Named(item.name, _item_number(program, item, base.scope)))
            continue
        while following in given:
            following += 1
        found.append(Named(item.name, following))
        following += 1
    _unique(found, base.type.place)
    return tuple(sorted(found, key=lambda named: named.value))


def addition_items(program: Program, base: Typed) -> tuple[Named, ...]:
    """Return the items after the ellipsis. One without a number gets the smallest free one above its predecessor's.

    Raises ImportFault if they do not ascend, or an item has the name or number of another. Source: X.680 20.4, 20.5.
    """
    assert isinstance(base.type, syntax.Enumerated)
    root = root_items(program, base)
    taken = {named.value for named in root}
    found: list[Named] = []
    following = 0
    for item in base.type.additions:
        if item.value is not None:
            value = _item_number(program, item, base.scope)
        else:
            while following in taken:
                following += 1
            value = following
        if value < following:
            raise fault(item.place, f"{item.name}: values of additions must ascend", "X.680 20.5")
        found.append(Named(item.name, value))
        following = value + 1
    _unique([*root, *found], base.type.place)
    return tuple(found)


def _unique(items: list[Named], place: Place) -> None:
    if len({item.name for item in items}) < len(items) or len({item.value for item in items}) < len(items):
        raise fault(place, "two items of an ENUMERATED are the same", "X.680 20.4")


def default(program: Program, value: syntax.Value, scope: Scope, governor: Typed) -> Default:
    """Return a DEFAULT with all references resolved.

    Raises ImportFault for a DEFAULT of NULL or of another unsupported type. Raises it also for a name that is not a
    value, item or bit of the component's type.
    """
    base = program.base(governor)
    if isinstance(value, syntax.Word) and value.module is None and value.name in scope.bound:
        bound = scope.bound[value.name]
        if bound.actual.value is not None:
            return default(program, bound.actual.value, bound.scope, governor)
    match base.type, value:
        case syntax.Plain(name="NULL"), _:
            raise fault(value.place, "unsupported: DEFAULT of NULL; make it OPTIONAL", "X.680 25.9")
        case syntax.Plain(name="BOOLEAN"), syntax.Word(name="TRUE" | "FALSE"):
            return value.name == "TRUE"
        case syntax.Plain(name="BOOLEAN"), syntax.Word():
            return bool(number(program, value, scope, base))
        case syntax.WithItems(name="INTEGER"), _:
            return number(program, value, scope, base)
        case syntax.Enumerated(), syntax.Word():
            return _item_name(program, value, scope, base)
        case syntax.Plain(name="OCTET STRING"), syntax.Octets() if len(value.digits) % 2 == 0:
            return bytes.fromhex(value.digits)
        case syntax.WithItems(name="BIT STRING"), syntax.Octets():
            return _packed("".join(f"{int(digit, 16):04b}" for digit in value.digits))
        case syntax.WithItems(name="BIT STRING"), syntax.Bits():
            return _packed(value.digits)
        case syntax.WithItems(name="BIT STRING"), syntax.Braces():
            return _named_bits(program, value, base)
        case syntax.Plain(name=name), syntax.Text() if name.endswith("String"):
            return value.value
    if isinstance(value, syntax.Word):
        assigned, inside = _assigned(program, value, scope)
        with program.step(value.place):
            return default(program, assigned.value, inside, Typed(assigned.type, inside))
    raise fault(value.place, "unsupported: DEFAULT of this type", "X.680 25.9")


def _item_name(program: Program, word: syntax.Word, scope: Scope, base: Typed) -> str:
    items = names(program, base)
    if word.module is None and any(item.name == word.name for item in items):
        return word.name
    value = number(program, word, scope, base)
    found = [item.name for item in items if item.value == value]
    if not found:
        raise fault(word.place, f"no item has the number {value}", "X.680 20")
    return found[0]


def _packed(digits: str) -> tuple[bytes, int]:
    size = (len(digits) + 7) // 8
    return int(digits.ljust(size * 8, "0") or "0", 2).to_bytes(size, "big"), len(digits)


def _named_bits(program: Program, value: syntax.Braces, base: Typed) -> tuple[bytes, int]:
    bits = dict(names(program, base))
    wanted = [token.text for token in value.inside if token.text != ","]
    unknown = [name for name in wanted if name not in bits]
    if unknown:
        raise fault(value.place, f"no bit is named {unknown[0]}", "X.680 22.11")
    at = {bits[name] for name in wanted}
    return _packed("".join("01"[bit in at] for bit in range(max(at, default=-1) + 1)))
