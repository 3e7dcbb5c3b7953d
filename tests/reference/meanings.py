"""Meanings of names, read from docstrings: lines `name  meaning`, of which continuation lines are indented."""

import inspect
import re
from collections.abc import Callable

ROW = re.compile(r"([\w.\[\]-]+(?:, [\w.\[\]-]+)*) {2,}(\S.*)")

STANDARD = ("builtins", "enum", "typing")  # modules of bases that are not ours


def meanings(of: type | Callable[..., object]) -> dict[str, str]:
    """Return the meaning of each name in the docstring, a class's bases included; names of one row have the same."""
    if isinstance(of, type):
        bases = [_rows(base) for base in reversed(of.__mro__) if base.__module__ not in STANDARD]
        return {name: text for rows in bases for name, text in rows.items()}
    return _rows(of)


def _rows(of: type | Callable[..., object]) -> dict[str, str]:
    found: dict[str, list[str]] = {}
    names: list[str] = []
    for line in _lines(of):
        if row := ROW.fullmatch(line):
            names = row[1].split(", ")
            found |= {name: [row[2]] for name in names}
        elif names and line.startswith(" "):
            for name in names:
                found[name].append(line.strip())
        else:
            names = []
    return {name: " ".join(parts) for name, parts in found.items()}


def summary(of: type | Callable[..., object]) -> str:
    """Return the first paragraph of the docstring, on one line."""
    lines = _lines(of)
    end = lines.index("") if "" in lines else len(lines)
    return " ".join(line.strip() for line in lines[:end])


def _lines(of: type | Callable[..., object]) -> list[str]:
    return inspect.cleandoc(of.__doc__ or "").splitlines()
