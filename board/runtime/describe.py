"""Reads TOML into frozen dataclasses; reports all mistakes at once, with remedies.

A field's type gives the valid values of its key:

bool, int, float, str  as in TOML; Literal for choices; a nested dataclass, a union
`tuple[T, ...]`, `dict[str, T]`  arrays and tables
`T | None`  an optional key
`object`  a value that another module reads
`Annotated[int, Range(0, 65535)]`  a number with bounds
`Annotated[str, Check(parse)]`  a value with a check of its own

The key is the field's name, without the trailing underscore of names such as `class_`. `__post_init__` checks
relations between keys. It raises ConfigurationError with one line per mistake, which begins with the key.
"""

import dataclasses
import math
import operator
import re
from collections.abc import Callable, Iterable, Mapping, Set
from functools import cache
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, NamedTuple, TypeVar, Union, get_args, get_origin, get_type_hints

from board.runtime.errors import ConfigurationError
from board.runtime.toml import NAMES, kind_name, load, override, show

__all__ = ["Check", "Range", "all_of", "at_key", "load", "override", "read"]

T = TypeVar("T")

WORD = re.compile(r"\w+")
INDEX = re.compile(r"\[\d+\]")
BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")

RULES = (("at least", operator.ge), ("at most", operator.le), ("above", operator.gt), ("below", operator.lt))


class Range(NamedTuple):
    """Bounds of a number: min and max are inclusive, above and below exclusive."""

    min: float | None = None
    max: float | None = None
    above: float | None = None
    below: float | None = None

    def __str__(self) -> str:
        bounds = zip(RULES, self, strict=True)
        return " and ".join(f"{word} {_plain(bound)}" for (word, _), bound in bounds if bound is not None)

    def holds(self, value: float) -> bool:
        bounds = zip(RULES, self, strict=True)
        return all(bound is None or rule(value, bound) for (_, rule), bound in bounds)


class Check(NamedTuple):
    """Additional check of a value: look() raises ConfigurationError if it is invalid."""

    look: Callable[[Any], object]


def _plain(bound: float) -> float:
    """Return 90 for 90.0, so that equal bounds have equal texts; `typing` caches them as equal too."""
    return int(bound) if bound == int(bound) else bound


def read(kind: type[T], table: Mapping[str, object], where: str, path: str = "") -> T:
    """Return the frozen dataclass of a table that load() returned.

    where  name of the file, at the beginning of each line of the message.
    path   key of the table, unless it is the whole file.

    Raises ConfigurationError with one line per mistake: `file: key.path: what is wrong; what to do`.
    """
    reading = _Reading(where)
    value: T = reading.table(kind, table, path)
    if reading.mistakes:
        raise ConfigurationError("\n".join(reading.mistakes))
    return value


class _Reading:
    """One pass over a description (a TOML table); it continues after a mistake, to report all mistakes."""

    def __init__(self, where: str) -> None:
        self.where = where
        self.mistakes: list[str] = []

    def wrong(self, path: str, text: str) -> None:
        self.mistakes.append(f"{self.where}: {path}: {text}" if path else f"{self.where}: {text}")

    def table(self, kind: Any, table: Mapping[str, object], path: str) -> Any:
        fields = {field.name.rstrip("_"): field for field in dataclasses.fields(kind) if field.init}
        hints = _hints(kind)
        before = len(self.mistakes)
        for key in table:
            if key not in fields:
                self.wrong(_join(path, key), f"is not a known key; {remedy(key, fields)}")
        values, is_whole = {}, True
        for key, field in fields.items():
            hint, place, told = hints[field.name], _join(path, key), len(self.mistakes)
            is_needed = field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING
            if key not in table and not is_needed:
                continue
            value = self.value(hint, table[key], place) if key in table else self.absent(hint, place)
            if len(self.mistakes) == told:
                values[field.name] = value
            elif is_needed:
                is_whole = False
        wrong = table.keys() - values.keys() if len(self.mistakes) > before else None
        return self.made(kind, values, path, wrong) if is_whole else None

    def made(self, kind: Any, values: Mapping[str, object], path: str, wrong: Set[str] | None) -> Any:
        """Create the dataclass; collect the mistakes that it reports.

        wrong  keys with mistakes; None without any. Defaults replace them, so mistakes that name them are omitted.
        """
        try:
            found = kind(**values)
        except ConfigurationError as error:
            for line in error.message.split("\n"):
                first, *more = WORD.findall(line) or [""]
                if wrong is None or (first in values and wrong.isdisjoint(more)):
                    self.wrong(path, f"{line}; {error.hint}" if error.hint else line)
            return None
        return found if wrong is None else None

    def absent(self, hint: Any, path: str) -> Any:
        """Return the value for an absent key without a default; report it if the key is required."""
        if dataclasses.is_dataclass(hint):
            return self.table(hint, {}, path)
        if NoneType not in get_args(hint):
            self.wrong(path, f"is missing; give {_wanted(hint)}")
        return None

    def value(self, hint: Any, value: Any, path: str) -> Any:
        origin, arguments = get_origin(hint), get_args(hint)
        if origin is Annotated:
            value = self.bounded(arguments, value, path)
        elif origin in (Union, UnionType):
            value = self.either(hint, value, path)
        elif origin is Literal:
            if not any(value == choice and type(value) is type(choice) for choice in arguments):
                self.wrong(path, f"{show(value)} is not a choice; {remedy(value, arguments, show)}")
        elif dataclasses.is_dataclass(hint) and isinstance(value, dict):
            value = self.table(hint, value, path)
        elif origin is tuple and isinstance(value, list):
            value = tuple(self.value(arguments[0], item, f"{path}[{at}]") for at, item in enumerate(value))
        elif origin is dict and isinstance(value, dict):
            value = {key: self.value(arguments[1], item, _join(path, key)) for key, item in value.items()}
        elif hint is float and type(value) in (int, float):
            value = self.number(value, path)
        elif hint not in (object, Any) and type(value) is not hint:
            self.wrong(path, f"{show(value)} is {kind_name(value)}; {_brackets(hint, value, path)}")
        return value

    def bounded(self, arguments: tuple[Any, ...], value: Any, path: str) -> Any:
        """Check a value against its Range and Check annotations; other annotations are ignored."""
        before = len(self.mistakes)
        value = self.value(arguments[0], value, path)
        for bounds in arguments[1:]:
            if len(self.mistakes) == before and isinstance(bounds, Range) and not bounds.holds(value):
                self.wrong(path, f"{show(value)} is out of range; give {bounds}")
            elif len(self.mistakes) == before and isinstance(bounds, Check):
                self.checked(bounds, value, path)
        return value

    def checked(self, check: Check, value: Any, path: str) -> None:
        try:
            check.look(value)
        except ConfigurationError as error:
            self.wrong(path, _told(error))

    def either(self, hint: Any, value: Any, path: str) -> Any:
        """Return the value as the first alternative of a union that accepts it."""
        kinds = [kind for kind in get_args(hint) if kind is not NoneType]
        if len(kinds) == 1:
            return self.value(kinds[0], value, path)
        for kind in kinds:
            trial = _Reading(self.where)
            found = trial.value(kind, value, path)
            if not trial.mistakes:
                return found
        self.wrong(path, f"{show(value)} is {kind_name(value)}; give {_wanted(hint)}")
        return None

    def number(self, value: float, path: str) -> float:
        # TOML integers may exceed the exponent of a float, and TOML has the values `nan` and `inf`.
        if (isinstance(value, int) and value.bit_length() > 1023) or not math.isfinite(value):
            self.wrong(path, f"{show(value)} is not finite; give a number")
            return 0.0
        return float(value)


@cache
def _hints(kind: Any) -> dict[str, Any]:
    """Return the types of the fields. Without a cache, this takes most of the time for a table of 10,000 rows."""
    return get_type_hints(kind, include_extras=True)


def all_of(checks: Iterable[Callable[[], object]]) -> None:
    """Call each check of a `__post_init__`. Raises one ConfigurationError with a line for each that a check raised."""
    mistakes = []
    for check in checks:
        try:
            check()
        except ConfigurationError as error:
            mistakes.append(error)
    if len(mistakes) == 1:
        raise mistakes[0]
    if mistakes:
        raise ConfigurationError("\n".join(_told(error) for error in mistakes))


def at_key(key: str, look: Callable[[Any], object], value: object) -> None:
    """Check a value for all_of(). Raises ConfigurationError as look() does, with the key in front."""
    try:
        look(value)
    except ConfigurationError as error:
        raise ConfigurationError(f"{key}: {error.message}", error.hint) from error


def _told(error: ConfigurationError) -> str:
    return f"{error.message}; {error.hint}" if error.hint else error.message


def _join(path: str, key: str) -> str:
    key = key if BARE_KEY.fullmatch(key) else show(key)
    return f"{path}.{key}" if path else key


def _brackets(hint: Any, value: object, path: str) -> str:
    """Return what to write: `[key]` in place of `[[key]]` or the reverse if the brackets are wrong, else the type."""
    key = INDEX.sub("", path)
    if get_origin(hint) is tuple and isinstance(value, dict) and dataclasses.is_dataclass(get_args(hint)[0]):
        return f"write [[{key}]]"
    if dataclasses.is_dataclass(hint) and isinstance(value, list) and value and isinstance(value[0], dict):
        return f"write [{key}]"
    return f"give {_wanted(hint)}"


def _wanted(hint: Any) -> str:
    """Return the type and bounds of a key in words."""
    origin, arguments = get_origin(hint), get_args(hint)
    if origin is Annotated:
        bounds = [str(item) for item in arguments[1:] if isinstance(item, Range)]
        return " ".join([_wanted(arguments[0]), *bounds])
    if origin in (Union, UnionType):
        return " or ".join(_wanted(kind) for kind in arguments if kind is not NoneType)
    if origin is Literal:
        return "one of " + ", ".join(show(choice) for choice in arguments)
    return "a table" if dataclasses.is_dataclass(hint) else NAMES.get(origin or hint, "a value")


def remedy(word: object, known: Iterable[object], show: Callable[[object], str] = str) -> str:
    """Suggest the closest known word, or list all of them if none is close."""
    names = [show(name) for name in known]
    return did_you_mean(show(word), names) or f"known: {', '.join(names) or 'none'}"


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Return a question with the closest known word; empty if none is close."""
    from difflib import get_close_matches

    close = get_close_matches(word, known, n=1)
    return f"did you mean {close[0]}?" if close else ""
