import pytest
from hypothesis import given
from hypothesis import strategies as st

from firmware.codec.bits import rows, shown
from tests.firmware.codec.standin import Step


@pytest.mark.parametrize(
    ("bit", "width", "text"),
    [
        (0, 8, "10100101"),
        (4, 1, "0"),
        (6, 4, "0111"),
        (0, 16, "1010010111110000"),
        (4, 20, "0x5f00f"),
        (0, 17, "0xa5f00"),
        (20, 0, ""),
        (20, 8, "11110000"),
    ],
)
def test_bits_are_shown_as_they_stand(bit, width, text):
    assert shown(bytes.fromhex("a5f00f"), bit, width) == text


@given(st.binary(max_size=40), st.integers(0, 400), st.integers(0, 400))
def test_any_stretch_is_shown_even_where_the_octets_end(octets, bit, width):
    assert len(shown(octets, bit, width)) <= 36


def test_a_long_string_is_cut():
    assert shown(bytes(100), 0, 800) == "0x" + "0" * 32 + ".."


def test_what_stands_in_a_container_is_deeper():
    steps = [
        Step("enter", 0, 0, "cam", "CoopAwareness"),
        Step("presence", 0, 2, "cam", "", "10"),
        Step("value", 2, 8, "cam.speed", "SpeedValue", "5 (0.05 m/s)", "0.01 m/s", "11.5.7.2"),
        Step("leave", 10, 0, "cam"),
        Step("padding", 10, 6, "", "", "000000"),
    ]
    found = list(rows(bytes(2), steps))
    assert [(row.depth, row.name, row.value) for row in found] == [
        (0, "cam", "CoopAwareness"),
        (1, "(presence)", "10"),
        (1, "speed", "5 (0.05 m/s)"),
        (0, "(padding)", "000000"),
    ]
    assert found[2].bits == "00000000"
    assert found[2].clause == "11.5.7.2"
