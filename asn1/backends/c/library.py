"""C library of a layout: headers, code and tables per module, list of messages."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from asn1.backends.c.decode import decoder
from asn1.backends.c.encode import encoder
from asn1.backends.c.header import private_header, public_header, title
from asn1.backends.c.names import has_check, member, needs_functions
from asn1.backends.c.predicate import Predicates
from asn1.backends.c.short_names import short_names
from asn1.backends.c.tables import tables, text
from asn1.backends.c.validate import validator
from asn1.layout.layout import lay_out
from asn1.layout.memory import arena_octets
from asn1.layout.nodes import Layout, Node
from asn1.model.types import Message, Module, Schema

__all__ = ["generate", "member", "write"]


def generate(schema: Schema, messages: Sequence[str], folder: Path) -> list[Path]:
    """Write the C code of some messages: include/captain/*.h and src/*. The runtime is not copied.

    Returns the files, sorted by name. The same schema gives the same octets.
    Raises ValueError for a type without a layout, KeyError for an unknown message.
    """
    return write(lay_out(schema, [schema.messages[name] for name in messages]), folder)


def write(layout: Layout, folder: Path) -> list[Path]:
    """Write the C code of a layout, as `generate` does. Returns the files, sorted by name."""
    files = {}
    for key, nodes in layout.nodes.items():
        module = layout.schema.modules[key]
        files[f"include/captain/{key}.h"] = public_header(module, nodes)
        files[f"src/{key}.h"] = private_header(module, nodes)
        files[f"src/{key}.c"] = _code(module, nodes)
        files[f"src/{key}_tables.c"] = tables(module, nodes)
    files["include/captain/messages.h"] = _messages_header(layout)
    files["src/messages.c"] = _messages(layout)
    for name, content in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(content, encoding="utf-8")
    return [folder / name for name in sorted(files)]


def _code(module: Module, nodes: list[Node]) -> str:
    predicates = Predicates()
    functions: list[str] = []
    for node in nodes:
        if needs_functions(node):
            functions += [*decoder(node), *encoder(node)]
        if has_check(node):
            checks = validator(node, predicates)
            functions += [*predicates.functions, *checks]
            predicates.functions = []
    others = sorted({child.module for node in nodes for child in node.children()} - {module.key})
    includes = [f'#include "{key}.h"' for key in (module.key, *others)]
    return "\n".join([*title(module), *includes, "", *functions])


def _messages_header(layout: Layout) -> str:
    """Return captain/messages.h, which includes the headers of all modules."""
    lines = [
        "/* All messages of this library: made by captain-asn1. */",
        "#ifndef CAPTAIN_MESSAGES_H",
        "#define CAPTAIN_MESSAGES_H",
        "",
    ]
    lines += [f"#include <captain/{key}.h>" for key in sorted(layout.nodes)]
    return "\n".join([*lines, "", "#endif", ""])


def _messages(layout: Layout) -> str:
    messages = sorted(layout.messages, key=lambda message: (message.type, message.rank, message.name))
    modules = sorted({layout.pdus[message.name].module for message in messages})
    of_forms = sorted({layout.pdus[message.name].module for message in messages if message.form_of})
    lines = [
        "/* The list of the messages: made by captain-asn1. */",
        *(f"#include <captain/{key}.h>" for key in modules),
        *(f'#include "{key}.h"' for key in of_forms),
        "",
    ]
    for index, message in enumerate(messages):
        lines += _message(layout, message, index)
    # C has no empty array, so a list without messages has one NULL.
    rows = [f"    &message_{index}," for index in range(len(messages))] or ["    NULL,"]
    lines += ["", "const captain_message *const captain_messages[] = {", *rows, "};"]
    return "\n".join([*lines, f"const size_t captain_messages_count = {len(messages)};", ""])


def _message(layout: Layout, message: Message, index: int) -> Iterator[str]:
    pdu = layout.pdus[message.name]
    yield f"static const captain_message message_{index} = {{"
    yield f"    .name = {text(message.name)}, .type = {text(message.type)}, .standard = {text(message.standard)},"
    yield f"    .module = {text(layout.schema.modules[pdu.module].name)}, .pdu = &{pdu.c_name}_type,"
    for name, values in (("ids", message.ids), ("versions", message.versions)):
        if values:
            yield f"    .{name} = (const uint8_t[]){{{', '.join(map(str, values))}}}, .{name}_count = {len(values)},"
    yield f"    .release = {message.release}, .is_experimental = {'true' if message.is_experimental else 'false'},"
    if message.form_of:
        yield f"    .form_of = {text(message.form_of)},"
    yield f"    .btp_port = {message.btp_port}, .rank = {message.rank}, .arena = {arena_octets(pdu)},"
    if names := short_names(message.form_of or message.name):
        yield "    .short_names = (const captain_short_name[]){"
        yield from (f"        {{{text(name)}, {text(path)}}}," for name, path in names.items())
        yield f"    }}, .short_names_count = {len(names)},"
    yield "};"
