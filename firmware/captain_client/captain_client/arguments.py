"""Arguments of the client: checks that name the argument and its value."""

import math
import os
from collections.abc import Iterator, Mapping, Sequence
from reprlib import repr as short

MOST_S = 1e9  # longest timeout: 31 years, in milliseconds still far below the limits of libzmq
SCALAR = str | int | float | bool | None  # types that JSON has as values, and converts to names


def check_text(name: str, value: object, remedy: str = "") -> None:
    """Raise ValueError if an argument is not a text. remedy: what to write; empty if it is obvious."""
    _check(isinstance(value, str), name, value, f"is not a text; {remedy}" if remedy else "is not a text")


def check_texts(name: str, values: Sequence[object]) -> None:
    """Raise ValueError if one of the positional arguments is not a text."""
    for value in values:
        check_text(name, value, "give each one as an argument of its own")


def check_path(name: str, value: object) -> str:
    """Return an argument with a path as a text. Raises ValueError if it is neither a text nor a path."""
    path = os.fspath(value) if isinstance(value, os.PathLike) else value
    _check(isinstance(path, str), name, value, "is not a path")
    return str(path)


def check_seconds(name: str, value: object) -> None:
    """Raise ValueError if an argument is not a finite time in seconds, from 0."""
    is_time = isinstance(value, int | float) and not isinstance(value, bool) and 0 <= value < MOST_S
    _check(is_time, name, value, "is not a time in seconds")


def check_mapping(name: str, value: object, others: str = "") -> None:
    """Raise ValueError if an argument is not a dict. others: types that it may have as well."""
    _check(isinstance(value, Mapping), name, value, f"is not a dict{others}")


def faults(value: object, path: str) -> Iterator[str]:
    """Yield each part of a value that JSON does not have, as `path: value and problem`. path: that of the value."""
    if isinstance(value, dict):
        for name, part in value.items():
            below = f"{path}.{name}" if path else f"{name}"
            if not isinstance(name, SCALAR):
                yield f"{below}: the name is not a text"
            yield from faults(part, below)
    elif isinstance(value, list | tuple):
        for index, part in enumerate(value):
            yield from faults(part, f"{path}[{index}]")
    elif isinstance(value, float) and not math.isfinite(value):
        yield f"{path}: {value!r} is not a finite number; leave it out if it is unknown"
    elif not isinstance(value, SCALAR):
        yield f"{path}: {short(value)} is not a number, text, bool, list or dict, but {type(value).__name__}"


def _check(is_valid: bool, name: str, value: object, problem: str) -> None:
    if not is_valid:
        raise ValueError(f"{name}: {short(value)} {problem}")
