"""Units: one spelling, whatever the comments of the modules say."""

import re

import pytest

from asn1.importer.parser.type_parser import unit_of
from asn1.importer.resolver.units import Units, components_of, read_units
from asn1.model import types as t
from asn1.model.text import load_schema

SYMBOLS = {
    "%", "1/m", "Hz", "Pa", "Wh", "axle", "bogie", "dB", "dB(A)", "dBm", "day", "degree", "degree Celsius", "degree/s",
    "degree/s^2", "h", "kPa", "kbit/s", "kg", "km/h", "m", "m/s", "m/s^2", "min", "mm/h", "month", "ms", "octet",
    "person", "s", "us", "year",
}  # fmt: skip
FACTOR = re.compile(r"(?:[0-9]+(?:\.[0-9]+)?(?:e-?[0-9]+)?|360/65535|1/30000|10\^exponent|10\^\(exponent \+ 2\)) ")


@pytest.mark.parametrize(
    ("comment", "unit"),
    [
        ("* @unit: 0,1 metre ", "0,1 metre"),
        ("* words\n * @unit 0,1 m/s^2\n * @category: x", "0,1 m/s^2"),
        ("* @units: cm", "cm"),
        ("*\n * Unit: 0,1 degree\n", "0,1 degree"),
        ("* @unitary", None),
        ("* @unit:\n * more", None),
        (" @unit: ms", "ms"),
    ],
)
def test_a_unit_stands_behind_its_tag(comment: str, unit: str | None) -> None:
    assert unit_of((comment,)) == unit


def test_only_the_last_documentation_in_front_of_a_type_counts() -> None:
    assert unit_of(("* @unit: s", " a remark", "* @brief nothing")) is None
    assert unit_of(("* @unit: s", " a remark")) == "s"


@pytest.mark.parametrize(
    ("comment", "unit"),
    [
        ("0,1 metre", "0.1 m"),
        ("0.1  metre", "0.1 m"),
        ("10^-7 degree", "1e-7 degree"),
        ("0,01 degree per second. ", "0.01 degree/s"),
        ("N/A", None),
        ("0,7 furlong", "0.7 furlong"),
    ],
)
def test_a_unit_gets_the_spelling_of_the_schema(comment: str, unit: str | None) -> None:
    assert read_units().normal(comment) == unit


def test_every_unit_of_the_committed_schema_is_a_factor_and_a_known_symbol() -> None:
    units = {unit for module in load_schema().modules.values() for unit in _units(module)}
    assert len(units) > 30
    odd = {unit for unit in units if FACTOR.sub("", unit, count=1) not in SYMBOLS}
    assert odd == {"0.01"}  # CorrelationCellValue has none but its scale


def test_the_table_takes_a_unit_away() -> None:
    module = t.Module("k", "K", "", "s", "f", "0", {"A": t.Definition("A", t.Integer(), "m")})
    assert Units({}, {"k": {"A": ""}}).add(module, []).definitions["A"].unit is None


def test_the_table_reaches_into_groups_lists_and_choices() -> None:
    number = t.Component("n", t.Integer())
    choice = t.Choice((), True, (t.Group((t.Component("c", t.Sequence((number,))),)),))
    module = t.Module("k", "K", "", "s", "f", "0", {"A": t.Definition("A", t.SequenceOf(choice))})
    units = Units({}, {"k": {"A.c.n": "m"}})
    assert units.unused({"k": module}) == []
    found = units.add(module, []).definitions["A"].type
    assert isinstance(found, t.SequenceOf)
    assert isinstance(found.element, t.Choice)
    (component,) = components_of(found.element)
    assert component.type == t.Sequence((t.Component("n", t.Integer(), unit="m"),))


def _units(module: t.Module) -> list[str]:
    found = [one.unit for one in module.definitions.values()]
    waiting = [one.type for one in module.definitions.values()]
    while waiting:
        match waiting.pop():
            case t.Sequence() | t.Choice() as structure:
                components = components_of(structure)
                found += [one.unit for one in components]
                waiting += [one.type for one in components]
            case t.SequenceOf(element=element):
                waiting.append(element)
    return [unit for unit in found if unit is not None]
