"""The third frame of a message to the PULL socket: a JSON object, each key checked, each mistake named."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from board.runtime.errors import RequestError
from drivers.message import Area, Position, Shape
from firmware.routing.options import MAX_FRAME, NO_OPTIONS, Parsed, parse
from tests.said import tells

CIRCLE = {"shape": "circle", "latitude": 48.7668616, "longitude": 11.432068, "distance_a": 500}


def parsed(**table: object) -> Parsed:
    return parse(json.dumps(table).encode())


def refusal(frame: bytes) -> str:
    with pytest.raises(RequestError) as caught:
        parse(frame)
    return str(caught.value)


def test_an_empty_object_asks_nothing() -> None:
    assert parse(b"{}") == Parsed(NO_OPTIONS, None)


def test_all_options_at_once_are_read() -> None:
    options, area = parsed(
        label="run 7",
        interfaces=["g5", "mqtt"],
        btp_port=3000,
        traffic_class=255,
        priority=0,
        lifetime_s=2.5,
        hop_limit=3,
        area={**CIRCLE, "shape": "ellipse", "distance_b": 20, "angle": 45},
    )
    assert (options.label, options.interfaces, options.btp_port) == ("run 7", ("g5", "mqtt"), 3000)
    assert (options.traffic_class, options.priority) == (255, 0)
    assert (options.lifetime_s, options.hop_limit) == (2.5, 3)
    assert area == Area(Shape.ELLIPSE, Position(487668616, 114320680), 500, 20, 45)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("label", ""),
        ("label", "ünïcode ☃"),
        ("interfaces", []),
        ("btp_port", 0),
        ("btp_port", 65535),
        ("traffic_class", 0),
        ("priority", 7),
        ("lifetime_s", 0.001),
        ("lifetime_s", 86400),
        ("interfaces", ["*"]),
        ("area", CIRCLE),
        ("area", {**CIRCLE, "latitude": -90, "longitude": 180}),
        ("area", {**CIRCLE, "shape": "rectangle", "distance_b": 65535, "angle": 360}),
    ],
)
def test_this_value_is_taken(key: str, value: object) -> None:
    parsed(**{key: value})


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("label", 5),
        ("label", None),
        ("interfaces", "g5"),
        ("interfaces", [5]),
        ("interfaces", {"g5": 1}),
        ("btp_port", -1),
        ("btp_port", 65536),
        ("btp_port", 2001.0),
        ("btp_port", "2001"),
        ("btp_port", True),
        ("traffic_class", 256),
        ("traffic_class", -1),
        ("priority", 8),
        ("priority", -1),
        ("lifetime_s", -0.1),
        ("lifetime_s", 86401),
        ("lifetime_s", "1"),
        ("lifetime_s", float("nan")),
        ("lifetime_s", float("inf")),
        ("hop_limit", 0),
        ("hop_limit", 256),
        ("area", "circle"),
        ("area", []),
    ],
)
def test_this_value_is_refused_and_its_key_named(key: str, value: object) -> None:
    assert f"options: {key}" in refusal(json.dumps({key: value}).encode())


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("shape", "square"),
        ("shape", 0),
        ("latitude", 90.1),
        ("latitude", None),
        ("longitude", -180.1),
        ("distance_a", -1),
        ("distance_a", 65536),
        ("distance_b", 0.5),
        ("angle", 361),
        ("radius", 5),
    ],
)
def test_this_value_in_an_area_is_refused_and_its_place_named(key: str, value: object) -> None:
    assert f"options: area.{key}" in refusal(json.dumps({"area": {**CIRCLE, key: value}}).encode())


@pytest.mark.parametrize("key", ["shape", "latitude", "longitude", "distance_a"])
def test_an_area_without_this_key_is_refused(key: str) -> None:
    area = {name: value for name, value in CIRCLE.items() if name != key}
    assert f"options: area.{key}: is missing" in refusal(json.dumps({"area": area}).encode())


def test_key_that_is_unknown_is_refused_with_the_nearest_one() -> None:
    assert tells(refusal(b'{"prioritty": 1}'), "prioritty", " priority?")
    assert tells(refusal(b'{"lifetime": 1}'), "lifetime", " lifetime_s?")


def test_all_mistakes_of_a_frame_are_named_at_once() -> None:
    text = refusal(b'{"priority": 9, "hop_limit": 0, "colour": "red"}')
    assert all(key in text for key in ("priority", "hop_limit", "colour"))


@pytest.mark.parametrize(
    "frame",
    [
        b"",
        b"{",
        b"nonsense",
        b"\xff\xfe\x00",
        b"{'label': 'x'}",
        b"{} {}",
        b"[" * MAX_FRAME,
        b'{"area":' * 500,
        b'{"label": "\xff"}',
        b"\x00",
    ],
)
def test_what_is_not_json_is_refused(frame: bytes) -> None:
    assert refusal(frame).startswith("options: not JSON")


@pytest.mark.parametrize("frame", [b"[]", b"null", b"5", b'"label"', b"true", b"[[[[]]]]"])
def test_what_is_no_object_is_refused(frame: bytes) -> None:
    assert "not an object" in refusal(frame)


def test_a_frame_as_long_as_the_limit_is_read_and_one_octet_more_is_not() -> None:
    frame = b'{"label": "%s"}' % (b"x" * (MAX_FRAME - 13))
    assert len(frame) == MAX_FRAME
    assert len(parse(frame).options.label) == MAX_FRAME - 13
    assert f"{MAX_FRAME + 1} octets" in refusal(frame + b" ")


def test_a_number_beyond_a_float_is_refused() -> None:
    assert "not finite" in refusal(b'{"lifetime_s": 1e999}')
    assert "not finite" in refusal(b'{"lifetime_s": 1%s}' % (b"0" * 400))


@given(st.binary(max_size=200))
def test_any_octets_are_read_or_refused_in_words(frame: bytes) -> None:
    try:
        parse(frame)
    except RequestError as error:
        assert error.message.startswith("options:")


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4),
)
KEYS = st.sampled_from(["label", "interfaces", "btp_port", "priority", "lifetime_s", "hop_limit", "area"])


@given(st.dictionaries(KEYS, JSON, max_size=5))
def test_any_json_under_the_right_keys_is_read_or_refused_in_words(table: dict[str, object]) -> None:
    try:
        parse(json.dumps(table).encode())
    except RequestError as error:
        assert error.message.startswith("options:")


@pytest.mark.parametrize(
    "area",
    [
        {**CIRCLE, "distance_a": 0},
        {**CIRCLE, "distance_b": 1},
        {**CIRCLE, "angle": 1},
        {**CIRCLE, "shape": "rectangle"},
        {**CIRCLE, "shape": "ellipse", "distance_b": 0},
    ],
)
def test_an_area_that_nobody_can_be_in_or_that_has_too_much_is_refused(area: dict[str, object]) -> None:
    with pytest.raises(RequestError, match="area"):
        parsed(area=area)


@pytest.mark.parametrize("hop_limit", [1, 255])
def test_a_hop_limit_goes_with_an_area(hop_limit: int) -> None:
    assert parsed(area=CIRCLE, hop_limit=hop_limit).options.hop_limit == hop_limit
    with pytest.raises(RequestError, match="hop_limit"):
        parsed(hop_limit=hop_limit)


def test_a_message_without_a_life_is_refused() -> None:
    with pytest.raises(RequestError, match="lifetime_s"):
        parsed(lifetime_s=0)
