"""ASN.1 text to a schema, without editions: for texts that a test writes, or that the schema wrote of itself."""

from asn1.importer.parser.fault import Place
from asn1.importer.parser.module_parser import parse
from asn1.importer.resolver.program import Source
from asn1.importer.resolver.resolver import Resolver
from asn1.importer.resolver.units import read_units
from asn1.model import types as t

NOWHERE = Place("test", 1)


def imported(texts: dict[str, str], root: t.Reference) -> t.Schema:
    """texts: by key, one module each. Only what the root reaches."""
    parsed = {key: parse(text, key)[0] for key, text in texts.items()}
    keys = {module.name: key for key, module in parsed.items()}
    sources = {key: Source(key, module, keys) for key, module in parsed.items()}
    resolved = Resolver(sources, read_units()).resolve([(root.module, root.name, NOWHERE)])
    modules = {
        key: t.Module(key, parsed[key].name, parsed[key].oid, "", "", "", one.definitions, one.classes, one.sets)
        for key, one in resolved.items()
    }
    return t.Schema(modules, {})


def snippet(text: str, name: str) -> tuple[t.Schema, t.Reference]:
    """Of assignments alone; the module is called Test."""
    root = t.Reference("r1_test", name)
    return imported({"r1_test": f"Test DEFINITIONS AUTOMATIC TAGS ::= BEGIN\n{text}\nEND"}, root), root
