"""Short names of fields, by message: reads asn1/names.toml."""

import tomllib
from functools import cache
from pathlib import Path

TABLE = Path(__file__).parents[2] / "names.toml"


def short_names(message: str) -> dict[str, str]:
    """Return the path of each short name of a message; empty for a message without a table."""
    return _tables().get(message, {})


@cache
def _tables() -> dict[str, dict[str, str]]:
    found: dict[str, dict[str, str]] = {}
    for table in tomllib.loads(TABLE.read_text(encoding="utf-8"))["table"]:
        places = table.get("places", {})
        paths = {name: path.format_map(places) for name, path in table["names"].items()}
        for message in table["messages"]:
            found.setdefault(message, {}).update(paths)
    return found
