"""JSON of a station: no number or table ends the node."""

import pytest

from firmware.gateway.captain_gateway.captain_gateway.told import number, table


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (1.5, 1.5),
        (3, 3.0),
        (0, 0.0),
        (9, 9.0),
        (9.5, None),
        (-1.0, None),
        (None, None),
        ("3", None),
        ([], None),
        (True, None),
        (1e300, None),
        (float("nan"), None),
        (10**400, None),
    ],
)
def test_a_number_is_one_that_it_may_be_or_none(value, expected):
    assert number({"time": value}, "time", 0.0, 9.0) == expected
    assert number({}, "time", 0.0, 9.0) is None


@pytest.mark.parametrize("octets", [b"", b"[]", b"7", b"\xff", b"{", b'{"a": "\\ud800"}', b"[" * 100_000])
def test_what_is_no_table_of_text_that_ros_can_say_is_none(octets):
    assert table(octets) is None


def test_a_whole_pair_of_surrogates_is_a_character():
    assert table(b'{"a": "\\ud83d\\ude97"}') == {"a": "\U0001f697"}
