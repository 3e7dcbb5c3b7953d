"""Values of an option in words: its type with bounds, its default, its unit."""

import dataclasses
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from board.runtime.describe import Range
from board.runtime.toml import show

# By the end of an option's name, the longest first; and of those whose name has no unit.
UNITS = {
    "_m_s": "m/s", "_hz": "Hz", "_ms": "ms", "_ns": "ns", "_mb": "MB", "_dbm": "dBm", "_ohm": "ohm", "_s": "s",
    "_m": "m", "_v": "V", "_a": "A", "_c": "°C",
}  # fmt: skip
UNIT_OF = {
    "latitude": "degrees", "longitude": "degrees", "angle": "degrees", "baud": "bit/s", "rate_per_s": "1/s",
    "receive_buffer": "octets", "distance_a": "m", "distance_b": "m", "speeds_m_s": "m/s",
}  # fmt: skip
OF_A_BUS = frozenset({"address", "i2c_address"})  # hexadecimal, as i2cdetect has them
NAMES = {bool: "true or false", int: "integer", float: "number", str: "text", object: "value", Any: "value"}


def inner_kind(hint: Any) -> type | None:
    """Return the dataclass that a hint holds, itself or in a tuple, a table or an alternative."""
    if dataclasses.is_dataclass(hint):
        return hint if isinstance(hint, type) else None
    found = (
        inner_kind(one) for one in get_args(hint) if get_origin(hint) in (Union, UnionType, tuple, dict, Annotated)
    )
    return next(filter(None, found), None)


def value_of(hint: Any, key: str = "") -> str:
    """Return the values that an option may have."""
    origin, arguments = get_origin(hint), get_args(hint)
    if origin is Annotated:
        bounds = [_range(one, key) for one in arguments[1:] if isinstance(one, Range)]
        return bounds[0] if bounds else value_of(arguments[0], key)
    if origin in (Union, UnionType):
        return " or ".join(value_of(one, key) for one in arguments if one is not NoneType)
    if origin is Literal:
        return ", ".join(f"`{show(one)}`" for one in arguments)
    if origin is tuple:
        return "tables" if inner_kind(hint) else f"list: {value_of(arguments[0], key)}"
    if origin is dict:
        return "tables" if inner_kind(hint) else f"table of {value_of(arguments[1])}"
    return "table" if dataclasses.is_dataclass(hint) else NAMES[hint]


def _range(bounds: Range, key: str) -> str:
    if bounds.min is not None and bounds.max is not None:
        return f"{_number(bounds.min, key)} to {_number(bounds.max, key)}"
    return str(bounds)


def _number(value: float, key: str) -> str:
    if key in OF_A_BUS:
        return f"{value:#04x}"
    return f"{int(value):,}" if value == int(value) else f"{value:g}"


def default_of(field: dataclasses.Field[Any]) -> str:
    """Return the default of an option; empty without one."""
    value = field.default
    if field.default_factory is not dataclasses.MISSING:
        value = field.default_factory()
    if value is dataclasses.MISSING:
        return "required"
    if value is None or value == {} or dataclasses.is_dataclass(value):
        return ""
    if isinstance(value, tuple):
        return "below" if _are_tables(value) else "`[" + ", ".join(map(show, value)) + "]`"
    is_of_a_bus = field.name in OF_A_BUS and isinstance(value, int)
    return f"`{value:#04x}`" if is_of_a_bus else f"`{show(value)}`"


def long_default(field: dataclasses.Field[Any]) -> str:
    """Return a default that is an array of tables, as TOML; empty for any other."""
    if not _are_tables(field.default):
        return ""
    rows = [{key.name: getattr(one, key.name) for key in dataclasses.fields(one)} for one in field.default]
    lines = ["    { " + ", ".join(f"{key} = {show(one)}" for key, one in row.items()) + " }," for row in rows]
    return "\n".join([f"Default of `{field.name}`:", "", "```", f"{field.name} = [", *lines, "]", "```"])


def _are_tables(value: object) -> bool:
    return isinstance(value, tuple) and any(map(dataclasses.is_dataclass, value))


def unit_of(key: str) -> str:
    """Return the unit of an option, by its name."""
    return UNIT_OF.get(key) or next((unit for end, unit in UNITS.items() if key.endswith(end)), "")
