"""File of the station's own message types: adds and removes a row."""

import json
import os
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from asn1.own.wish import WishError

HEADING = "# Own message types of the station, written by `captain-asn1 add` and `captain-asn1 remove`.\n"
# firmware/config/registered.py reads these files by the same rule; asn1 and firmware do not import each other.
VARIABLE = "CAPTAIN_TYPES"
SYSTEM = Path("/etc/captain/types.toml")
LIMITS = {
    "traffic_class": 255,
    "priority": 7,
    "lifetime_s": 86400,
}  # bounds of [[types]] in captain.toml; the least is 0


class TypeRow(NamedTuple):
    """Row of the file, with the keys and defaults of [[types]] in captain.toml."""

    number: int
    name: str
    btp_port: int
    priority: int = 3
    lifetime_s: float = 1.0
    traffic_class: int = 2

    def check(self) -> None:
        """Raise WishError for a value that the station refuses."""
        for key, most in LIMITS.items():
            value = getattr(self, key)
            if not 0 <= value <= most:
                option = key.removesuffix("_s").replace("_", "-")
                raise WishError(f"--{option} {value}: out of range; 0 to {most}")


def type_name(name: str) -> str:
    """Return the name of a message in envelopes, where `.` and `-` are not allowed."""
    return re.sub(r"[.-]", "_", name)


def file_of(environment: Mapping[str, str] = os.environ) -> Path | None:
    """Return the file of the stations of this user; for root, that of the machine. None if CAPTAIN_TYPES is empty."""
    given = environment.get(VARIABLE)
    if given is not None:
        return Path(given) if given else None
    if os.geteuid() == 0:
        return SYSTEM
    home = environment.get("XDG_CONFIG_HOME") or Path(environment.get("HOME", "/"), ".config")
    return Path(home, "captain", "types.toml")


class Types:
    """Rows of a file. Raises WishError if the file is not one that captain-asn1 has written.

    path  the file, which need not exist.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._rows = _read(path) if path.exists() else []

    def add(self, row: TypeRow) -> str | None:
        """Add a row, in place of the one with its name. Return why it is impossible; None if it is done.

        Raises WishError if the file cannot be written.
        """
        others = [one for one in self._rows if one["name"] != row.name]
        for one in others:
            if one["number"] == row.number:
                return (
                    f"{self.path} has messageID {row.number} as {one['name']}; remove that row, or choose another --id"
                )
        self._write([*others, row._asdict()])
        return None

    def remove(self, name: str) -> bool:
        """Remove the row with a name. Return whether there was one. Raises WishError if the file cannot be written."""
        others = [one for one in self._rows if one["name"] != name]
        has_it = len(others) < len(self._rows)
        if has_it:
            self._write(others)
        return has_it

    def _write(self, rows: list[dict[str, object]]) -> None:
        """Write the file by rename, so that a station never reads a part of it. Raises WishError if that fails."""
        self._rows = rows
        tables = (
            "\n[[types]]\n" + "".join(f"{key} = {json.dumps(row[key], ensure_ascii=False)}\n" for key in row)
            for row in rows
        )
        beside = self.path.with_name(self.path.name + ".new")
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            beside.write_text(HEADING + "".join(tables), encoding="utf-8")
            beside.replace(self.path)
        except OSError as error:
            raise WishError(f"{self.path}: cannot be written: {error.strerror}") from error


def _read(path: Path) -> list[dict[str, object]]:
    """Return the rows of a file. Raises WishError if it has something else."""
    try:
        tables = tomllib.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:  # UnicodeDecodeError and TOMLDecodeError are two
        raise WishError(f"{path}: not TOML: {error}; correct the file, or delete it") from error
    rows = tables.get("types", [])
    if tables.keys() - {"types"} or not isinstance(rows, list) or not all(map(_is_row, rows)):
        raise WishError(f"{path}: has more than rows [[types]] with number and name; correct the file, or delete it")
    return rows


def _is_row(row: object) -> bool:
    if not isinstance(row, dict) or not {"number", "name"} <= row.keys():
        return False
    return all(isinstance(value, int | float | str) for value in row.values())
