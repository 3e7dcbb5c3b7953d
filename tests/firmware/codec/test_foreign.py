"""Foreign input is named by its own words, and nothing else is taken for it."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from firmware.codec import foreign
from tests.said import tells


def frame(message_id: int, size: int) -> bytes:
    """A MessageFrame with so many octets inside (X.691 11.9.3: lengths below 128 have one octet, others two)."""
    length = bytes([size]) if size < 128 else (0x8000 | size).to_bytes(2)
    return message_id.to_bytes(2) + length + bytes(size)


@pytest.mark.parametrize("size", [1, 127, 128, 16383])
@pytest.mark.parametrize(
    ("message_id", "name"),
    [
        (18, "MapData (MAP)"),
        (20, "BasicSafetyMessage (BSM)"),
        (41, "SensorDataSharingMessage (SDSM)"),
        (243, "TestMessage03"),
    ],
)
def test_message_frame_of_any_length_is_named(message_id: int, name: str, size: int):
    told = foreign.message_frame(frame(message_id, size))
    assert tells(told, "MessageFrame", "SAE J2735", f": messageId {message_id}, {name}; ", "ETSI ITS")


BSM = "SAE J2735 MessageFrame (messageId 20, BasicSafetyMessage (BSM))"


@pytest.mark.parametrize(
    ("change", "cause"),
    [
        (frame(20, 30) + b"\0", f"1 octet follows the {BSM}"),
        (frame(20, 30) + bytes(13), f"13 octets follow the {BSM}"),
        (frame(20, 30)[:-1], f"truncated {BSM}: 32 of 33 octets"),
    ],
)
def test_a_message_frame_of_another_length_is_only_a_likely_cause(change: bytes, cause: str):
    assert foreign.message_frame(change) is None
    assert foreign.damaged_message_frame(change) == cause


@pytest.mark.parametrize(
    "octets",
    [
        b"",
        b"\0\x14\x01",
        frame(2, 30),  # an id of no message
        b"\x02" + frame(20, 30)[1:],  # protocolVersion 2
        b"\x80" + frame(20, 30)[1:],  # extended
        b"\0\x14\xc1" + bytes(16384),  # in fragments
    ],
)
def test_octets_that_are_no_message_frame_are_not_named(octets: bytes):
    assert foreign.message_frame(octets) is None
    assert foreign.damaged_message_frame(octets) is None


@given(st.binary(max_size=60))
def test_no_octets_with_a_protocol_version_are_a_message_frame(octets: bytes):
    assert foreign.message_frame(b"\x01" + octets) is None
    named = foreign.message_frame(b"\0" + octets)
    assert named is None or octets[0] in foreign.J2735


@given(st.text(max_size=80))
def test_any_text_in_xml_has_a_root_element_or_none(text: str):
    found = foreign.xml(f"<{text}", [])
    assert found is not None
    assert "root element" in found.why


@pytest.mark.parametrize("begin", ["<", "<a>", f"<{'a' * 60}>"])
def test_a_line_of_100_kb_that_begins_an_element_is_not_a_whole_one(begin: str):
    # Minutes where the name of an element has no bound: the time grows with its square.
    for line in (begin + "a" * 100_000, begin + "</a" * 33_000):
        found = foreign.xml(line, [])
        assert found is not None
        assert not found.is_whole


@pytest.mark.parametrize("text", ["<a/>", "<a>1</a>", ' <a b="c">\n<d/>\n</a > '])
def test_an_element_from_its_first_to_its_last_tag_is_a_whole_one(text: str):
    following = iter(["next"])
    found = foreign.xml(text, following)
    assert found is not None
    assert found.is_whole
    assert list(following) == ["next"]


@pytest.mark.parametrize("text", ["", "{", "0202", " x<a>"])
def test_a_line_without_an_angle_bracket_at_its_begin_is_no_xml(text: str):
    assert foreign.xml(text, ["<a/>"]) is None


def test_an_element_of_many_lines_is_named_by_the_first_thousand():
    following = iter(["\n"] * 2000)
    found = foreign.xml("<!-- \n", following)
    assert found is not None
    assert (found.is_whole, len(list(following))) == (False, 1001)
