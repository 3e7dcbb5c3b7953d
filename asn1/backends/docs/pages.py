"""Pages of messages: fields with types, ranges, units, special values, presence and clause.

They are Markdown, which terminals, editors and forges show with links. The same schema gives the same octets.
"""

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from asn1.backends.docs.wording import bounds, presence, type_name, unit_of
from asn1.model.types import (
    BitString,
    Choice,
    ClassField,
    Component,
    Definition,
    Enumerated,
    Group,
    Integer,
    Message,
    Module,
    Named,
    OpenType,
    Reference,
    Schema,
    Sequence,
    SequenceOf,
    Type,
)


def write(schema: Schema, messages: Iterable[str], folder: Path, progress: Callable[[str], None]) -> None:
    """Write a page <message>.md for each message, and README.md that lists them.

    One page covers both forms of a message.
    """
    folder.mkdir(parents=True, exist_ok=True)
    named = [schema.messages[name] for name in messages]
    chosen = list(dict.fromkeys(schema.messages[one.form_of] if one.form_of else one for one in named))
    for message in chosen:
        progress(message.name)
        (folder / f"{message.name}.md").write_text(page(schema, message), encoding="utf-8")
    (folder / "README.md").write_text(index(schema, chosen), encoding="utf-8")


def index(schema: Schema, messages: Iterable[Message]) -> str:
    """Return README.md: the list of pages."""
    rows = [
        (f"[{message.name}]({message.name}.md)", f"`{message.pdu.name}`", message.standard, str(message.btp_port))
        for message in messages
    ]
    return "\n".join(["# Messages", "", *_table(("message", "PDU", "standard", "BTP port"), rows), ""])


def page(schema: Schema, message: Message) -> str:
    """Return the page of a message: every type that it contains, once, in the order of first reference."""
    module = schema.modules[message.pdu.module]
    facts = [
        ("standard", message.standard),
        ("release", str(message.release) + (", experimental" if message.is_experimental else "")),
        ("module", f"{module.name} `{module.oid}`" if module.oid else module.name),
        ("PDU", f"[{message.pdu.name}](#{_anchor(message.pdu.module, message.pdu.name)})"),
        ("messageID", _numbers(message.ids)),
        ("protocolVersion", _numbers(message.versions)),
        ("BTP port", str(message.btp_port) if message.btp_port else "none"),
    ]
    forms = [one for one in schema.messages.values() if one.form_of == message.name]
    facts += [("-ext form", f"`{one.name}`: {one.standard}") for one in forms]
    lines = [f"# {message.name}", "", *_table(("", ""), facts), ""]
    for section in _sections(schema, message.pdu):
        lines += section_text(schema, section)
    return "\n".join(lines)


class Section(NamedTuple):
    """A type with a heading of its own: a definition, or an unnamed type inside one ("Parent.field")."""

    module: Module
    name: str
    type: Type
    unit: str | None = None
    owner: Type | None = None  # for an open type: the SEQUENCE that contains it


def section_text(schema: Schema, section: Section) -> list[str]:
    """Return the lines of a section: heading, clause, kind and bounds, and a table of its contents."""
    kind = type_name(section.type, _link)
    facts = [kind, bounds(schema, section.type), f"unit {section.unit}" if section.unit else ""]
    lines = [
        f'## <a id="{_anchor(section.module.key, section.name)}"></a>{section.name}',
        "",
        f"Clause: {section.module.standard}, {section.name}  ",
        " · ".join(fact for fact in facts if fact),
        "",
    ]
    return lines + list(_contents(schema, section))


def _contents(schema: Schema, section: Section) -> Iterator[str]:
    type_ = section.type
    match type_:
        case Sequence():
            heads = ("field", "type", "presence", "values", "unit")
            rows = []
            for component, addition in _members(type_):
                name, shown, values, unit = _field(schema, section, component)
                rows.append((name, shown, presence(component, addition), values, unit))
            yield from _table(heads, rows)
        case Choice():
            rows = [(*_field(schema, section, component), "" if addition is None else f"extension {addition}")
                    for component, addition in _members(type_)]  # fmt: skip
            yield from _table(("alternative", "type", "values", "unit", ""), rows)
        case OpenType():
            table = schema.modules[type_.set_.module].sets[type_.set_.name]
            held = [(str(row.value), type_name(row.type, _link)) for row in table.rows]
            yield from _table((f"`{type_.selector}`", "type"), held)
        case Integer(names=names) | BitString(names=names):
            yield from _named(names, "bit" if isinstance(type_, BitString) else "value")
        case Enumerated():
            items = [(str(item.value), item.name) for item in type_.root]
            items += [(str(item.value), f"{item.name} (extension)") for item in type_.additions]
            yield from _table(("value", "name"), items)
        case _:
            return
    yield ""


def _field(schema: Schema, section: Section, component: Component) -> tuple[str, str, str, str]:
    """Return name, type, bounds and unit of a component or alternative."""
    type_ = component.type
    if isinstance(type_, ClassField):
        type_ = schema.modules[type_.class_.module].classes[type_.class_.name].id_type
    unit = component.unit or unit_of(schema, type_) or ""
    if _has_section(type_):
        name = f"{section.name}.{component.name}"
        shown = f"[{NAMELESS.get(type(type_), type_name(type_, _link))}](#{_anchor(section.module.key, name)})"
    else:
        shown = type_name(type_, _link)
    return f"`{component.name}`", shown, bounds(schema, type_), unit


NAMELESS: dict[type, str] = {SequenceOf: "SEQUENCE OF"}  # Markdown has no links inside links


# ---------------------------------------------------------------- sections of a page


def _sections(schema: Schema, pdu: Reference) -> Iterator[Section]:
    """Yield the PDU and all types that it reaches, depth first, each once."""
    seen: set[tuple[str, str]] = set()
    waiting = [_section(schema, pdu)]
    while waiting:
        section = waiting.pop()
        if (section.module.key, section.name) in seen:
            continue
        seen.add((section.module.key, section.name))
        yield section
        waiting += reversed(list(_inside(schema, section)))


def _section(schema: Schema, reference: Reference) -> Section:
    definition: Definition = schema.resolve(reference)
    return Section(schema.modules[reference.module], definition.name, definition.type, definition.unit)


def _inside(schema: Schema, section: Section) -> Iterator[Section]:
    """Yield the sections to which a section's text links."""
    type_ = section.type
    match type_:
        case Reference():
            yield _section(schema, type_)
        case SequenceOf():
            yield from _below(schema, section, "element", type_.element)
        case Sequence() | Choice():
            for component, _ in _members(type_):
                yield from _below(schema, section, component.name, component.type)
        case OpenType():
            for row in schema.modules[type_.set_.module].sets[type_.set_.name].rows:
                yield from _below(schema, section, str(row.value), row.type)
        case ClassField():
            class_ = schema.modules[type_.class_.module].classes[type_.class_.name]
            yield from _below(schema, section, class_.id_field, class_.id_type)
        case _:
            return


def _below(schema: Schema, section: Section, name: str, type_: Type) -> Iterator[Section]:
    if isinstance(type_, Reference):
        yield _section(schema, type_)
    elif _has_section(type_):
        yield Section(section.module, f"{section.name}.{name}", type_)
    elif isinstance(type_, SequenceOf | ClassField):
        yield from _inside(schema, section._replace(name=f"{section.name}.{name}", type=type_))


def _has_section(type_: Type) -> bool:
    """Return whether an unnamed type needs a section of its own, because a table row cannot show it."""
    match type_:
        case Sequence() | Choice() | Enumerated() | OpenType():
            return True
        case Integer(names=names) | BitString(names=names):
            return bool(names)
        case SequenceOf():
            return not isinstance(type_.element, Reference) and _has_section(type_.element)
        case _:
            return False


def _members(type_: Sequence | Choice) -> Iterator[tuple[Component, int | None]]:
    """Yield components in the order of the text, each with the number of its extension addition, or None."""
    for component in type_.root:
        yield component, None
    for number, addition in enumerate(type_.additions, 1):
        for component in addition.components if isinstance(addition, Group) else (addition,):
            yield component, number
    if isinstance(type_, Sequence):
        for component in type_.tail:
            yield component, None


# ---------------------------------------------------------------- Markdown


def _named(names: Iterable[Named], head: str) -> Iterator[str]:
    rows = [(str(item.value), item.name) for item in names]
    yield from _table((head, "name"), rows) if rows else ()


def _table(heads: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> Iterator[str]:
    yield f"| {' | '.join(heads)} |"
    yield f"|{' --- |' * len(heads)}"
    for row in rows:
        yield f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in row)} |"


def _link(reference: Reference) -> str:
    return f"[{reference.name}](#{_anchor(reference.module, reference.name)})"


def _anchor(module: str, name: str) -> str:
    return f"{module}.{name}"


def _numbers(values: tuple[int, ...]) -> str:
    return ", ".join(map(str, values)) or "none"
