"""Tags of a CHOICE's alternatives, which decide their order in PER (X.691 23.3, X.680 8.6)."""

from asn1.importer.parser import syntax
from asn1.importer.parser.fault import fault
from asn1.importer.resolver.program import MAX_STEPS, Member, Program, Typed
from asn1.importer.resolver.values import PLAIN_NUMBER, number

_CLASSES = {"UNIVERSAL": 0, "APPLICATION": 1, "": 2, "PRIVATE": 3}
# Universal tags (X.680 8.4).
_UNIVERSAL = {
    "BOOLEAN": 1, "INTEGER": 2, "BIT STRING": 3, "OCTET STRING": 4, "NULL": 5, "OBJECT IDENTIFIER": 6,
    "ObjectDescriptor": 7, "EXTERNAL": 8, "REAL": 9, "EMBEDDED PDV": 11, "UTF8String": 12, "RELATIVE-OID": 13,
    "SEQUENCE": 16, "SET": 17, "NumericString": 18, "PrintableString": 19, "TeletexString": 20, "T61String": 20,
    "VideotexString": 21, "IA5String": 22, "UTCTime": 23, "GeneralizedTime": 24, "GraphicString": 25,
    "VisibleString": 26, "ISO646String": 26, "GeneralString": 27, "UniversalString": 28, "CHARACTER STRING": 29,
    "BMPString": 30,
}  # fmt: skip


def canonical(program: Program, choice: Typed) -> list[str]:
    """Return the names of a CHOICE's root alternatives in the order of their tags.

    Raises ImportFault if two have the same tag (X.680 29.3).
    """
    assert isinstance(choice.type, syntax.Structure)
    members = list(program.members(choice.type.members.root, choice.scope))
    if _is_automatic(program, choice):
        return [one.component.name for one in members]
    tags = {one.component.name: _tag(program, one) for one in members}
    if len(set(tags.values())) < len(tags):
        raise fault(choice.type.place, "two alternatives have the same tag", "X.680 29.3")
    return sorted(tags, key=lambda name: tags[name])


def _is_automatic(program: Program, choice: Typed) -> bool:
    """Return whether tags are automatic: the module says so, and no alternative has a tag (X.680 29.5, 25.3)."""
    source = program.sources[choice.scope.key]
    tagged = any(one.component.type.tag is not None for one in program.all_members(choice))
    return source.module.automatic_tags and not tagged


def _tag(program: Program, member: Member) -> tuple[int, int]:
    return _outermost(program, Typed(member.component.type, member.scope))


def _outermost(program: Program, typed: Typed) -> tuple[int, int]:
    for _ in range(MAX_STEPS):
        type_ = typed.type
        if type_.tag is not None:
            return _CLASSES[type_.tag.class_], number(program, type_.tag.number, typed.scope, PLAIN_NUMBER)
        if not isinstance(type_, syntax.Reference):
            break
        typed = program.target(type_, typed.scope)
    return _builtin(program, typed)


def _builtin(program: Program, typed: Typed) -> tuple[int, int]:
    match typed.type:
        case syntax.Structure(name="CHOICE"):
            if _is_automatic(program, typed):
                return _CLASSES[""], 0
            with program.step(typed.type.place):
                return min(_tag(program, one) for one in program.all_members(typed))
        case syntax.Plain(name=name) | syntax.WithItems(name=name) | syntax.Structure(name=name):
            if name in _UNIVERSAL:
                return 0, _UNIVERSAL[name]
        case syntax.Enumerated():
            return 0, 10
        case syntax.ListOf(is_set=is_set):
            return 0, 17 if is_set else 16
        case syntax.FieldOf():
            base = program.base(typed)
            if base.type is not typed.type:
                return _outermost(program, base)
    raise fault(typed.type.place, "unsupported: alternative without a tag", "X.680 29.3")
