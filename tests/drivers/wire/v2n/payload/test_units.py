"""SI units in JSON, and the ASN.1 types to which they belong."""

from typing import Any

import captain_messages
import pytest

from drivers.wire.v2n.payload.si import to_json
from drivers.wire.v2n.payload.si_read import from_json
from drivers.wire.v2n.payload.units import UNITS


@pytest.mark.parametrize(("name", "scale", "themselves"), [(name, *row) for name, row in UNITS.items()])
def test_every_unit_is_of_a_type_and_turns_both_ways(name: str, scale: float, themselves: frozenset[int]):
    kind = Integer(name)
    for raw in (-1000, -1, 0, 1, 7, 1021, 470_707_123, *themselves):
        there = to_json(kind, raw, name)
        assert from_json(kind, there, name) == raw
        assert there == (raw if raw in themselves else pytest.approx(raw / scale))


class Integer:
    """Named INTEGER type."""

    kind, low, high, names, fields, element, rows = "INTEGER", None, None, (), (), None, ()

    def __init__(self, name: str) -> None:
        self.name = name


def test_the_units_are_of_types_that_messages_have():
    # These types belong to messages of NAP that the library does not have, or to no message.
    foreign = {"SensorHeight", "SpeedValueExtended", "CartesianCoordinateLarge", "StandardLength12b", "Radius"}
    found: set[str] = set()
    for message in captain_messages.all():
        collect(message.type_tree(), found, 0)
    assert set(UNITS) - found <= foreign


def collect(kind: Any, found: set[str], depth: int) -> None:
    if depth < 12:
        found.add(kind.name or "")
        below = [*(field.type for field in kind.fields), *(row for _, row in kind.rows)]
        for one in [*below, *([kind.element] if kind.element else [])]:
            collect(one, found, depth + 1)
