"""Small ASN.1 texts through the importer, without files."""

from asn1.importer.parser.fault import ImportFault, Place
from asn1.importer.parser.module_parser import parse
from asn1.importer.resolver.program import Source
from asn1.importer.resolver.resolver import Resolved, Resolver
from asn1.importer.resolver.units import Units
from asn1.model import types

UNITS = Units({"0.1 metre": "0.1 m", "n/a": ""}, {})


def module(body: str, name: str = "M", imports: str = "", tags: str = "AUTOMATIC TAGS") -> str:
    """A module around some assignments; the first of them is in line 2."""
    return f"{name} DEFINITIONS {tags} ::= BEGIN {imports}\n{body}\nEND\n"


def imported(text: str, *wanted: str) -> dict[str, Resolved]:
    """What types of the first module of a text reach, by module key: the module's name in small letters."""
    parsed = parse(text, "m.asn")
    keys = {one.name: one.name.lower() for one in parsed}
    sources = {keys[one.name]: Source(keys[one.name], one, keys) for one in parsed}
    roots = [(keys[parsed[0].name], name, Place("m.asn", 1)) for name in wanted or ("A",)]
    return Resolver(sources, UNITS).resolve(roots)


def definition(body: str, name: str = "A") -> types.Type:
    """The type of one definition of a module around these assignments."""
    return imported(module(body), name)["m"].definitions[name].type


def problems(text: str, *wanted: str) -> list[str]:
    """What the importer says of a text that it refuses."""
    try:
        imported(text, *wanted)
    except ImportFault as error:
        return str(error).splitlines()
    raise AssertionError("nothing is wrong with this text")


def values(*ranges: tuple[int | None, int | None] | int) -> types.Values:
    return types.Values(tuple(types.Range(*((one, one) if isinstance(one, int) else one)) for one in ranges))


def limited(*ranges: tuple[int | None, int | None] | int, extensible: bool = False) -> types.Constraint:
    return types.Constraint(values(*ranges), extensible)


def ref(name: str, module: str = "m", *constraints: types.Constraint) -> types.Reference:
    return types.Reference(module=module, name=name, constraints=constraints)
