"""Own message types that `captain-asn1 add` has registered: rows beside those of captain.toml."""

import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from board.runtime import describe
from board.runtime.errors import ConfigurationError
from firmware.config import consistency
from firmware.config.tables import TypeConfig

# asn1/own/station.py writes these files by the same rule; asn1 and firmware do not import each other.
VARIABLE = "CAPTAIN_TYPES"
SYSTEM = "/etc/captain/types.toml"


@dataclass(frozen=True)
class TypesFile:
    """types.toml.

    types  rows with the keys of [[types]] in captain.toml.
    """

    types: tuple[TypeConfig, ...] = ()


def files(environment: Mapping[str, str] = os.environ) -> tuple[str, ...]:
    """Return the existing types.toml that a station reads: first the user's, whose rows win, then the machine's.

    CAPTAIN_TYPES names the only one; empty: none.
    """
    given = environment.get(VARIABLE)
    home = environment.get("XDG_CONFIG_HOME") or (Path(environment.get("HOME", "/"), ".config"))
    places = [str(Path(home, "captain", "types.toml")), SYSTEM] if given is None else [given]
    return tuple(place for place in places if os.path.isfile(place))


def completed(tables: dict[str, Any], paths: tuple[str, ...], errors: list[ConfigurationError]) -> dict[str, Any]:
    """Return the tables of a configuration with the rows of types.toml at the end of [[types]].

    A row is left out if an earlier row has its messageID or its name. Errors are added to `errors`.
    """
    rows = tables.get("types", [])
    if not isinstance(rows, list):
        return tables  # describe.read reports it
    taken = {one.get(key) for one in rows if isinstance(one, dict) for key in ("number", "name")}
    for path in paths:
        try:
            found = [_table(row) for row in rows_of(path)]
        except ConfigurationError as error:
            errors.append(error)
            continue
        for row in found:
            if taken.isdisjoint((row["number"], row["name"])):
                rows = [*rows, row]
                taken |= {row["number"], row["name"]}
    return {**tables, "types": rows} if rows else tables


def rows_of(path: str) -> tuple[TypeConfig, ...]:
    """Return the rows of a types.toml. Raises ConfigurationError with every mistake."""
    table = describe.load(path)
    if mistakes := list(consistency.types(table)):
        raise ConfigurationError("\n".join(f"{path}: {mistake}" for mistake in mistakes))
    return describe.read(TypesFile, table, path).types


def _table(row: TypeConfig) -> dict[str, Any]:
    return {key: value for key, value in asdict(row).items() if value is not None}
