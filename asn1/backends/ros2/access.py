"""Accessors for values of messages in SI units: Python text, one module per message package.

    from captain_si import etsi_its_cam_msgs as si
    si.speed_value(message.cam.cam_parameters....speed.speed_value)         # 13.89 (m/s), None where unavailable
    si.set_speed_value(..., 13.89)                                          # ValueError names the range

There is a function for each number with a unit in the schema: the single value of a message, or a field of one. The
standard's "out of range" is an infinite value, in both directions. Angles stay in degrees and temperatures in degrees
Celsius, as is usual. The generated modules import no message, so that they work with those of rclpy and of rosbags.
"""

import re
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import NamedTuple

from asn1.backends.ros2.model import Role, RosMessage, RosPackage
from asn1.backends.ros2.msg import unit_at
from asn1.backends.ros2.names import field_name
from asn1.model.constraints import value_bounds
from asn1.model.types import Constraint, Integer, Named, Reference, Schema, Type

NAME = "captain_si"
TEMPLATE = Path(__file__).parent / "template"

# Unit in the schema -> factor, and unit that the functions use. Days, months and years of a date are not durations, so
# they are omitted.
UNITS: dict[str, tuple[Fraction, str]] = {
    "m": (Fraction(1), "m"), "m/s": (Fraction(1), "m/s"), "km/h": (Fraction(1000, 3600), "m/s"),
    "m/s^2": (Fraction(1), "m/s^2"), "1/m": (Fraction(1), "1/m"),
    "degree": (Fraction(1), "degree"), "degree/s": (Fraction(1), "degree/s"),
    "us": (Fraction(1, 10**6), "s"), "ms": (Fraction(1, 1000), "s"), "s": (Fraction(1), "s"),
    "min": (Fraction(60), "s"), "h": (Fraction(3600), "s"),
    "kg": (Fraction(1), "kg"), "kPa": (Fraction(1000), "Pa"), "Wh": (Fraction(3600), "J"),
    "%": (Fraction(1, 100), "of 1"), "degree Celsius": (Fraction(1), "degree Celsius"),
    "kbit/s": (Fraction(1000), "bit/s"), "Hz": (Fraction(1), "Hz"),
}  # fmt: skip
_UNIT = re.compile(r"(?:(?P<count>[0-9.e/-]*[0-9]) )?(?P<unit>.+)")

# Names of numbers with a special meaning, in every spelling of the standards: unknown, or beyond an end of the range.
# They are part of SPECIAL in backends/c/runtime/src/plain.c.
NO_VALUE = ("unavailable", "unknown", "notAvailable")
BELOW = ("negativeOutOfRange", "negativeOutofRange", "outOfRangeNegative")
BEYOND = ("outOfRange", "positiveOutOfRange", "postiveOutOfRange", "outOfRangePositive")


class Quantity(NamedTuple):
    """A number of a message with its unit.

    of_one    value of 1 in the field, in `unit`.
    low, high  range of the field.
    no_value, below, beyond  special numbers of the field; None without one.
    about     description for the docstring.
    """

    function: str
    field: str
    of_one: Fraction
    unit: str
    low: int
    high: int
    no_value: int | None
    below: int | None
    beyond: int | None
    about: str


def quantities(schema: Schema, package: RosPackage) -> list[Quantity]:
    """Return the numbers with a unit in the messages of a package, sorted by the names of their functions."""
    found = [one for message in package.messages.values() for one in _of_message(schema, message)]
    return sorted(found)


def text(schema: Schema, package: RosPackage) -> str:
    """Return the text of the module."""
    parts = [_template("si.py.in").replace("@package@", package.name)]
    for one in quantities(schema, package):
        count, per = one.of_one.numerator, one.of_one.denominator
        known = {**one._asdict(), "count": count, "per": per}
        parts.append(FUNCTIONS.format(**known))
    return "\n\n".join(parts)


def _of_message(schema: Schema, message: RosMessage) -> Iterator[Quantity]:
    for field in message.fields:
        number = _integer(schema, field.schema_type)
        unit = unit_at(schema, message, field)
        if field.role is not Role.VALUE or field.is_array or number is None or unit is None or field.type[0].isupper():
            continue
        read = _read(unit)
        bounds = value_bounds(number[1])
        if read is None or bounds.low is None or bounds.high is None:
            continue
        yield Quantity(
            field_name(message.name) if not field.source else f"{field_name(message.name)}_{field.name}",
            field.name, *read, bounds.low, bounds.high,
            _named(number[0].names, NO_VALUE), _named(number[0].names, BELOW), _named(number[0].names, BEYOND),
            f"{message.definition.name} of {message.module.standard}: {bounds.low}..{bounds.high}, unit {unit}",
        )  # fmt: skip


def _integer(schema: Schema, type_: Type | None) -> tuple[Integer, tuple[Constraint, ...]] | None:
    constraints: tuple[Constraint, ...] = () if type_ is None else type_.constraints
    while isinstance(type_, Reference):
        type_ = schema.resolve(type_).type
        constraints = (*type_.constraints, *constraints)
    return (type_, constraints) if isinstance(type_, Integer) else None


def _read(unit: str) -> tuple[Fraction, str] | None:
    """Parse a unit: "0.01 m/s" gives 1/100 and "m/s". None for a unit that is not in UNITS."""
    match = _UNIT.fullmatch(unit)
    if match is None or match["unit"] not in UNITS:
        return None
    factor, name = UNITS[match["unit"]]
    return Fraction(match["count"] or "1") * factor, name


def _named(names: tuple[Named, ...], words: tuple[str, ...]) -> int | None:
    return next((one.value for one in names if one.name in words), None)


def _template(name: str) -> str:
    return (TEMPLATE / name).read_text(encoding="utf-8").rstrip() + "\n"


FUNCTIONS = '''def {function}(message):
    """In {unit}, None where unavailable. {about}."""
    return _value(message.{field}, {count}, {per}, {no_value}, {below}, {beyond})


def set_{function}(message, value):
    """In {unit}, None where unavailable. Raises ValueError beyond the range."""
    message.{field} = _number("{function}", value, {count}, {per}, {low}, {high}, {no_value}, {below}, {beyond})
'''
