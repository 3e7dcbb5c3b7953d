"""TOML descriptions read into frozen dataclasses: all mistakes of a file at once, each with what to do.

A field's type says what its key may hold: bool, int, float, str, Literal choices, a nested dataclass,
`tuple[T, ...]`, `dict[str, T]`, a union, `T | None` for what may be absent, `object` for what somebody else
reads, `Annotated[int, Range(0, 65535)]` for a number with bounds, and `Annotated[str, Check(parse)]` for a value
that more is asked of. The key is the field's name, without the underscore that keeps `class_` from being a keyword.
What several keys have to do with each other is checked in `__post_init__`, which raises ConfigurationError: a line for
each mistake, which begins with the key that has it.
"""

import dataclasses
import math
import operator
import re
from collections.abc import Callable, Iterable, Mapping, Set
from functools import cache
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, NamedTuple, TypeVar, Union, get_args, get_origin, get_type_hints

from board.errors import ConfigurationError
from board.toml import NAMES, kind_name, load, override, show

__all__ = ["Check", "Range", "all_of", "at_key", "load", "override", "read"]

T = TypeVar("T")

WORD = re.compile(r"\w+")
BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")

RULES = (("at least", operator.ge), ("at most", operator.le), ("above", operator.gt), ("below", operator.lt))


class Range(NamedTuple):
    """Bounds of a number: min and max belong to it, above and below do not."""

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
    """What else a value has to be: look raises ConfigurationError for one that it is not."""

    look: Callable[[Any], object]


def _plain(bound: float) -> float:
    """90 for 90.0: bounds that are equal shall read alike, and typing takes them for the same."""
    return int(bound) if bound == int(bound) else bound


def read(kind: type[T], table: Mapping[str, object], where: str, path: str = "") -> T:
    """A frozen dataclass from a table of load().

    where  begins every line of the message: the file's name.
    path   of the table itself, where it is not the whole file.

    Raises ConfigurationError with one line per mistake: `file: key.path: what is wrong; what to do`.
    """
    reading = _Reading(where)
    value: T = reading.table(kind, table, path)
    if reading.mistakes:
        raise ConfigurationError("\n".join(reading.mistakes))
    return value


class _Reading:
    """One pass over a description that goes on after a mistake."""

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
        """Of its values, defaults in place of the wrong ones; then what is said of others and not of these is told."""
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
        """The value of a key without a default that is not there."""
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
            self.wrong(path, f"{show(value)} is {kind_name(value)}; give {_wanted(hint)}")
        return value

    def bounded(self, arguments: tuple[Any, ...], value: Any, path: str) -> Any:
        """A number under Range, a value under Check; other annotations are somebody else's."""
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
        """The first alternative of a union that has nothing to say against the value."""
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
        # An integer of TOML may be longer than a float's exponent, and `nan` and `inf` are words of TOML.
        if (isinstance(value, int) and value.bit_length() > 1023) or not math.isfinite(value):
            self.wrong(path, f"{show(value)} is not finite; give a number")
            return 0.0
        return float(value)


@cache
def _hints(kind: Any) -> dict[str, Any]:
    """Types of the fields. Of 10,000 rows of a table they take most of the time."""
    return get_type_hints(kind, include_extras=True)


def all_of(checks: Iterable[Callable[[], object]]) -> None:
    """Call each, for a `__post_init__`. Raises one ConfigurationError with a line for each that any of them raised."""
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
    """A check for all_of(): what look raises of the value, with its key."""
    try:
        look(value)
    except ConfigurationError as error:
        raise ConfigurationError(f"{key}: {error.message}", error.hint) from error


def _told(error: ConfigurationError) -> str:
    return f"{error.message}; {error.hint}" if error.hint else error.message


def _join(path: str, key: str) -> str:
    key = key if BARE_KEY.fullmatch(key) else show(key)
    return f"{path}.{key}" if path else key


def _wanted(hint: Any) -> str:
    """What a key holds, in words."""
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
    """What may have been meant: the closest of the known words, or all of them."""
    from difflib import get_close_matches

    names = [show(name) for name in known]
    close = get_close_matches(show(word), names, n=1)
    return f"did you mean {close[0]}?" if close else f"known: {', '.join(names) or 'none'}"
