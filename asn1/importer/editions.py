"""Reader of editions.toml: file, standard and imports of each module."""

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from asn1.model import text, types

MODULES = text.FOLDER / "modules"


@dataclass(frozen=True, slots=True)
class Edition:
    """One module.

    key         key of the module
    name        its name in the text
    standard    document and version
    files       possible paths of its text in the imported directory; all that exist must agree
    imports     keys of the modules that it imports from
    units_from  keys of modules whose units apply to definitions with the same name and range
    keep        types that are kept though no message uses them, except superseded ones; `*` matches any letters
    is_ours     the file lies in asn1/modules
    """

    key: str
    name: str
    standard: str
    files: tuple[str, ...]
    imports: tuple[str, ...] = ()
    units_from: tuple[str, ...] = ()
    keep: tuple[str, ...] = ()
    is_ours: bool = False

    def paths(self, directory: Path) -> list[Path]:
        """Return the existing files of the module, without identical copies."""
        folder = MODULES if self.is_ours else directory
        present = [path for path in (folder / name for name in self.files) if path.is_file()]
        found: dict[bytes, Path] = {}
        for path in present:
            found.setdefault(path.read_bytes(), path)
        return list(found.values())


@dataclass(frozen=True, slots=True)
class Editions:
    """Contents of editions.toml: modules in its order, by key; messages by name."""

    modules: dict[str, Edition]
    messages: dict[str, types.Message]


def read_editions(path: Path = text.EDITIONS) -> Editions:
    """Read the project's file of editions. Raises OSError, tomllib.TOMLDecodeError, and KeyError for a missing key."""
    document = tomllib.loads(path.read_text(encoding="utf-8"))
    modules = [_edition(table) for table in document.get("module", [])]
    return Editions({one.key: one for one in modules}, {one.name: one for one in text.messages_of(document)})


def _edition(table: dict[str, Any]) -> Edition:
    return Edition(
        key=table["key"],
        name=table["name"],
        standard=table["standard"],
        files=tuple(table["files"]),
        imports=tuple(table.get("imports", [])),
        units_from=tuple(table.get("units_from", [])),
        keep=tuple(table.get("keep", [])),
        is_ours=table.get("ours", False),
    )
