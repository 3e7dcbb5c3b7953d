"""Import of the standards' modules to asn1/schema: commands `import` and `import-check`."""

import dataclasses
import difflib
import fnmatch
import hashlib
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

from asn1.importer.crosscheck import crosscheck
from asn1.importer.download import directory_of
from asn1.importer.editions import Edition, Editions, read_editions
from asn1.importer.feasible import require_feasible
from asn1.importer.parser import syntax
from asn1.importer.parser.fault import ImportFault, Place, Problem
from asn1.importer.parser.module_parser import Reading, read
from asn1.importer.resolver.program import Source
from asn1.importer.resolver.resolver import Resolved, Resolver
from asn1.importer.resolver.units import UNITS, read_units
from asn1.model import text, types


def import_modules(
    source: Path,
    table: Path = text.EDITIONS,
    units_table: Path = UNITS,
    folder: Path = text.SCHEMA,
    tell: Callable[[Problem], None] = lambda note: None,
) -> types.Schema:
    """Import the schema of every edition of editions.toml whose files exist.

    source       directory with the files, or a list of addresses to download (see download.py).
    table        path of editions.toml.
    units_table  path of units.toml.
    folder       earlier schema. If files of other editions are missing, definitions that those need are kept.
    tell         called for each file that asn1tools could not compare.

    Editions without files are omitted, with their messages. Raises ImportFault with every problem, MissingError without
    asn1tools, OSError for an unreadable file.
    """
    with directory_of(source) as directory:
        return _import(directory, table, units_table, folder, tell)


def missing_file(directory: Path) -> Path | None:
    """Return the path of one file of editions.toml if the directory has none of them; else None."""
    editions = [edition for edition in read_editions().modules.values() if not edition.is_ours]
    return None if any(edition.paths(directory) for edition in editions) else directory / editions[0].files[0]


def write_schema(schema: types.Schema, folder: Path = text.SCHEMA) -> list[Path]:
    """Write one file per module. Returns the changed files; files of other modules are kept."""
    folder.mkdir(parents=True, exist_ok=True)
    changed: list[Path] = []
    for key, module in schema.modules.items():
        path, new = folder / f"{key}.schema", text.dump(module)
        if not path.is_file() or path.read_text(encoding="utf-8") != new:
            path.write_text(new, encoding="utf-8")
            changed.append(path)
    return changed


def check(source: Path, folder: Path = text.SCHEMA) -> list[str]:
    """Return the differences between the schema in `folder` and an import, as lines of a unified diff.

    Only modules whose files exist are compared. Raises the errors of import_modules.
    """
    return compare(import_modules(source, folder=folder), source, folder)


def compare(schema: types.Schema, source: Path, folder: Path = text.SCHEMA) -> list[str]:
    """Return the lines of differences for a schema that is already imported. source: directory that the lines name."""
    lines: list[str] = []
    for key, module in schema.modules.items():
        path = folder / f"{key}.schema"
        old = path.read_text(encoding="utf-8").splitlines() if path.is_file() else []
        new = text.dump(module).splitlines()
        lines += difflib.unified_diff(old, new, str(path), f"{source}: {module.source}", lineterm="")
    return lines


def _import(
    directory: Path, table: Path, units_table: Path, folder: Path, tell: Callable[[Problem], None]
) -> types.Schema:
    editions = read_editions(table)
    readings: dict[Path, Reading] = {}
    found, problems = _present(editions, directory, readings, tell)
    sources = {key: _with_imports(one.source, found) for key, one in found.items()}
    problems += _missing(editions, found, directory)
    messages = {name: one for name, one in editions.messages.items() if one.pdu.module in sources}
    if not messages:
        none = Problem(Place(str(directory), 1), f"contains no file of {table.name}")
        raise ImportFault(problems or [none])
    place = Place(table.name, 1)
    roots = [(one.pdu.module, one.pdu.name, place) for one in messages.values()]
    roots += [(key, name, place) for key, one in found.items() for name in _kept(one)]
    is_whole = len(sources) == len(editions.modules)
    earlier = {} if is_whole else _earlier(folder, sources)
    roots += [
        (key, name, place)
        for key, module in earlier.items()
        for name in (*module.definitions, *module.classes, *module.sets)
        if name in sources[key].module.assignments
    ]
    units = read_units(units_table)
    resolved = _resolved(Resolver(sources, units), roots, list(readings.values()), problems)
    modules = {
        key: types.Module(
            key, found[key].edition.name, sources[key].module.oid, found[key].edition.standard, found[key].file,
            found[key].sha256, one.definitions, one.classes, one.sets, _left_out(found[key], one),
        )
        for key, one in resolved.items()
    }  # fmt: skip
    donors = _donors(found, modules, Resolver(sources, units))
    for key, module in earlier.items():
        donors[key].append(module.definitions)
    modules = {key: units.add(module, donors[key]) for key, module in modules.items()}
    unused = units.unused(modules)
    if unused and is_whole:
        raise ImportFault([Problem(Place(units_table.name, 1), f"unknown name: {one}") for one in unused])
    schema = types.Schema(modules, messages)
    require_feasible(schema, sources)
    return schema


# ---------------------------------------------------------------- finding and reading files


def _earlier(folder: Path, keys: Iterable[str]) -> dict[str, types.Module]:
    """Load these modules from the files of an earlier import."""
    paths = [path for path in (folder / f"{key}.schema" for key in keys) if path.is_file()]
    return {path.stem: text.load(path.read_text(encoding="utf-8"), path.name) for path in paths}


@dataclasses.dataclass(frozen=True, slots=True)
class _Found:
    edition: Edition
    source: Source
    file: str
    sha256: str


def _kept(found: _Found) -> list[str]:
    """Return the types that `keep` of the edition selects, even if no message uses them."""
    return [
        name
        for name, one in found.source.module.assignments.items()
        if isinstance(one, syntax.TypeAssignment) and not one.formals and not one.is_superseded
        if any(fnmatch.fnmatchcase(name, wanted) for wanted in found.edition.keep)
    ]


def _left_out(found: _Found, resolved: Resolved) -> tuple[str, ...]:
    """Return the names of the text's definitions that the schema omits, in the order of the text."""
    kept = {*resolved.definitions, *resolved.classes, *resolved.sets}
    return tuple(name for name in found.source.module.assignments if name not in kept)


def _present(
    editions: Editions, directory: Path, readings: dict[Path, Reading], tell: Callable[[Problem], None]
) -> tuple[dict[str, _Found], list[Problem]]:
    """Read the editions whose files exist. Returns them by key, and the problems found."""
    found: dict[str, _Found] = {}
    problems: list[Problem] = []
    for key, edition in editions.modules.items():
        paths = edition.paths(directory)
        try:
            read_ones = [_module_of(edition, path, directory, readings, problems, tell) for path in paths]
        except ImportFault as error:
            problems += error.problems
            continue
        modules = [module for module in read_ones if module]
        if not modules:
            continue
        problems += [
            Problem(other.place, f"{edition.name} differs from the module of the same name in {modules[0].place.file}")
            for other in modules[1:]
            if other.body != modules[0].body
        ]
        imports = {editions.modules[other].name: other for other in edition.imports}
        digest = hashlib.sha256(paths[0].read_bytes()).hexdigest()
        found[key] = _Found(edition, Source(key, modules[0], imports, edition.standard), paths[0].name, digest)
    return found, problems


def _resolved(
    resolver: Resolver, roots: list[tuple[str, str, Place]], readings: list[Reading], problems: list[Problem]
) -> dict[str, Resolved]:
    """Resolve all that the roots reach. Raises ImportFault with `problems` and those found here."""
    resolved: dict[str, Resolved] = {}
    try:
        resolved = resolver.resolve(roots)
    except ImportFault as error:
        more = error.problems
        for reading in readings if problems else []:
            more = reading.others(more)
        problems += [one for one in more if not (problems and one.text.startswith("no module "))]
    if problems:
        raise ImportFault(problems)
    return resolved


def _module_of(
    edition: Edition,
    path: Path,
    directory: Path,
    readings: dict[Path, Reading],
    problems: list[Problem],
    tell: Callable[[Problem], None],
) -> syntax.Module | None:
    """Return the edition's module in a file; None if it cannot be read. Each file is read once."""
    if path not in readings:
        file = str(path.relative_to(directory)) if path.is_relative_to(directory) else path.name
        words = _decoded(path.read_bytes())
        readings[path] = Reading([], [], set())  # an unreadable file is reported once
        readings[path] = read(words, file)
        problems += readings[path].problems
        if not readings[path].problems:
            _compare(words, file, readings[path].modules, problems, tell)
    for module in readings[path].modules:
        if module.name == edition.name:
            return module
    if readings[path].modules and not readings[path].problems:
        problems.append(Problem(readings[path].modules[0].place, f"no module {edition.name} in this file"))
    return None


def _compare(
    words: str, file: str, modules: list[syntax.Module], problems: list[Problem], tell: Callable[[Problem], None]
) -> None:
    """Compare the modules with asn1tools; differences are added to `problems`."""
    try:
        note = crosscheck(words, file, modules)
    except ImportFault as error:
        problems += error.problems
        return
    if note:
        tell(note)


def _decoded(octets: bytes) -> str:
    """Decode UTF-8, else Latin-1: ISO's files have comments in Latin-1."""
    try:
        return octets.decode("utf-8")
    except UnicodeDecodeError:
        return octets.decode("latin-1")


def _donors(
    found: Mapping[str, _Found], modules: Mapping[str, types.Module], resolver: Resolver
) -> dict[str, list[Mapping[str, types.Definition]]]:
    """Return, by module, the definitions of `units_from` with the same names, from which it may take units."""
    wanted = {
        key: [(other, name) for other in found[key].edition.units_from for name in module.definitions]
        for key, module in modules.items()
    }
    roots = [
        (other, name, found[other].source.module.place)
        for pairs in wanted.values()
        for other, name in pairs
        if other in found and _has_unit(found[other].source.module.assignments.get(name))
    ]
    resolved = resolver.resolve(roots)
    return {
        key: [resolved[other].definitions for other in found[key].edition.units_from if other in resolved]
        for key in modules
    }


def _has_unit(assignment: syntax.Assignment | None) -> bool:
    return (
        isinstance(assignment, syntax.TypeAssignment)
        and assignment.unit is not None
        and isinstance(assignment.type, syntax.WithItems)
    )


def _with_imports(source: Source, found: Mapping[str, _Found]) -> Source:
    """Return a source that imports only from modules whose files exist."""
    return dataclasses.replace(source, imports={name: key for name, key in source.imports.items() if key in found})


def _missing(editions: Editions, found: Mapping[str, _Found], directory: Path) -> list[Problem]:
    """Return a problem for each import from an edition whose files are missing."""
    return [
        Problem(one.source.module.place, f"imports from {editions.modules[key].files[0]}; this file is missing")
        for one in found.values()
        for key in one.source.imports.values()
        if key not in found and not editions.modules[key].paths(directory)
    ]
