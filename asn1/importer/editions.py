"""editions.toml: which module of which edition is in which file, and which modules it imports from."""

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from asn1 import text, types

MODULES = text.FOLDER / "modules"


@dataclass(frozen=True, slots=True)
class Edition:
    """One module.

    files       where its text may be: paths in the directory that is imported; those that are there have to agree
    imports     keys of the modules that it imports from
    units_from  keys of modules whose units hold for definitions of the same name and range
    keep        names of types, `*` for any letters, that are kept though no message reaches them, but for those that
                the standard itself has replaced
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
        """Those of its files that are there, without copies to the octet."""
        folder = MODULES if self.is_ours else directory
        present = [path for path in (folder / name for name in self.files) if path.is_file()]
        found: dict[bytes, Path] = {}
        for path in present:
            found.setdefault(path.read_bytes(), path)
        return list(found.values())


@dataclass(frozen=True, slots=True)
class Editions:
    """Modules in the order of the file, by key; messages by name."""

    modules: dict[str, Edition]
    messages: dict[str, types.Message]


def read_editions(path: Path = text.EDITIONS) -> Editions:
    """Raises OSError, tomllib.TOMLDecodeError, and KeyError where a line is missing: the file is the project's own."""
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
