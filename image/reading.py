"""A TOML file read into frozen dataclasses: all mistakes of its values at once, each with its place and what to do."""

import difflib
import tomllib
from collections.abc import Callable, Iterable
from dataclasses import MISSING, Field, fields, is_dataclass
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Literal, NamedTuple, TypeVar, Union, get_args, get_origin, get_type_hints

from image.errors import ImageError

T = TypeVar("T")

MOST_SHOWN = 60  # letters of a value
WORDS = {str: "text in quotes", int: "an integer", bool: "true or false", dict: "a table", list: "an array"}


class Check(NamedTuple):
    """What else a value has to be, beside its type: look says what it is not and what to do, or nothing."""

    look: Callable[[Any], str]


def within(low: int, high: int) -> Check:
    """Bounds of a number, both included."""
    remedy = f"give at least {low} and at most {high}"
    return Check(lambda number: "" if low <= number <= high else f"{show(number)} is out of range; {remedy}")


def read(kind: type[T], path: Path) -> T:
    """The file as a dataclass; hints: str, int, bool, Literal, dataclass, tuple, dict, X | None, Annotated with Check.

    Raises ImageError with a line for each mistake.
    """
    mistakes: list[str] = []
    found: T | None = _table(kind, _parsed(path), "", mistakes)
    if mistakes or found is None:
        raise ImageError("\n".join(f"{path}: {mistake}" for mistake in mistakes))
    return found


def show(value: object) -> str:
    """A value nearly as TOML writes it, shortened."""
    try:
        text = f'"{repr(value)[1:-1]}"' if isinstance(value, str) else str(value)
    except ValueError:  # an integer of more digits than Python writes
        return "the value"
    text = text.lower() if isinstance(value, bool) else text
    return text if len(text) <= MOST_SHOWN else f"{text[: MOST_SHOWN - 3]}..."


def _parsed(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise ImageError(f"{path}: cannot be read: {error.strerror}", "name a file like image/image.toml") from error
    except ValueError as error:  # UnicodeDecodeError and TOMLDecodeError
        text, _, place = str(error).removesuffix(")").partition(" (at ")
        raise ImageError(f"{path}: {place or 'not TOML'}: {text}") from error
    except RecursionError as error:
        raise ImageError(f"{path}: arrays or tables are nested too deep") from error


def _table(kind: Any, table: dict[str, Any], place: str, mistakes: list[str]) -> Any:
    """None where something is missing or wrong."""
    known = {field.name: field for field in fields(kind)}
    hints = get_type_hints(kind, include_extras=True)
    before = len(mistakes)
    mistakes += [f"{_joined(place, key)}: is not a known key; {_near(key, known)}" for key in table if key not in known]
    values = {}
    for name, field in known.items():
        if name in table:
            values[name] = _value(hints[name], table[name], _joined(place, name), mistakes)
        elif _is_needed(field):
            mistakes.append(f"{_joined(place, name)}: is missing; give {_wanted(hints[name])}")
    return kind(**values) if len(mistakes) == before else None


def _value(hint: Any, value: Any, place: str, mistakes: list[str]) -> Any:
    origin, inner = get_origin(hint), get_args(hint)
    if origin is Annotated:
        return _checked(inner, value, place, mistakes)
    if origin in (Union, UnionType):
        return _value(inner[0], value, place, mistakes)  # X | None: TOML has no null
    if origin is Literal:
        if not any(value == choice and type(value) is type(choice) for choice in inner):
            mistakes.append(f"{place}: {show(value)} is not a choice; {_near(value, inner)}")
        return value
    wanted = dict if is_dataclass(hint) else {tuple: list}.get(origin, origin or hint)
    if type(value) is not wanted:
        kind = next((words for one, words in WORDS.items() if type(value) is one), "something else")
        mistakes.append(f"{place}: {show(value)} is {kind}; give {_wanted(hint)}")
        return value
    if is_dataclass(hint):
        return _table(hint, value, place, mistakes)
    if origin is tuple:
        return tuple(_value(inner[0], one, f"{place}[{at}]", mistakes) for at, one in enumerate(value))
    if origin is dict:
        return {key: _value(inner[1], one, _joined(place, key), mistakes) for key, one in value.items()}
    return value


def _checked(inner: tuple[Any, ...], value: Any, place: str, mistakes: list[str]) -> Any:
    """A check looks at what the type and those before it have let pass."""
    before = len(mistakes)
    value = _value(inner[0], value, place, mistakes)
    for check in inner[1:]:
        if len(mistakes) == before and (said := check.look(value)):
            mistakes.append(f"{place}: {said}")
    return value


def _is_needed(field: "Field[Any]") -> bool:
    return field.default is MISSING and field.default_factory is MISSING


def _joined(place: str, key: str) -> str:
    key = key if key.isprintable() and key else show(key)
    return f"{place}.{key}" if place else key


def _wanted(hint: Any) -> str:
    origin, inner = get_origin(hint), get_args(hint)
    if origin in (Annotated, Union, UnionType):
        return _wanted(inner[0])
    if origin is Literal:
        return f"one of {', '.join(map(show, inner))}"
    return WORDS[dict if is_dataclass(hint) else {tuple: list}.get(origin, origin or hint)]


def _near(word: object, known: Iterable[object]) -> str:
    is_key = isinstance(known, dict)
    names = [str(one) if is_key else show(one) for one in known]
    close = difflib.get_close_matches(str(word) if is_key else show(word), names, 1)
    return f"did you mean {close[0]}?" if close else f"known: {', '.join(names)}"
