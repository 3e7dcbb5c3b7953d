"""JSON of the Python module: both dialects, their arguments, hostile texts, and what the type tree says of plain numbers."""

import re
import tracemalloc
from typing import Any

import pytest

from tests.asn1.codec import CAM, CAM_OCTETS, captain_messages

PLAIN: str = CAM.to_json(CAM_OCTETS, plain=True)
SPEED = "cam.camParameters.highFrequencyContainer.basicVehicleContainerHighFrequency.speed.speedValue"


def with_speed(text: str) -> str:
    return re.sub(r'"speedValue":[^,]*', lambda _: f'"speedValue":{text}', PLAIN)


def test_plain_by_name_only_gives_the_dialect():
    assert CAM.to_json(CAM_OCTETS, plain=False) == CAM.to_json(CAM_OCTETS) != PLAIN
    assert CAM.from_json(PLAIN, plain=True) == CAM.from_json(PLAIN.encode(), plain=1) == CAM_OCTETS
    with pytest.raises(captain_messages.EncodeError):
        CAM.from_json(PLAIN)
    for call in (CAM.to_json, CAM.from_json):
        for arguments, named in (((), {}), ((b"", True), {}), ((b"",), {"exact": True}), ((), {"plain": True})):
            with pytest.raises(TypeError, match="plain=True"):
                call(*arguments, **named)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("163.83", "out of range: 163.83 is not in 0..163.82 m/s"),
        ("9" * 400, f"out of range: {'9' * 40}... is not in 0..163.82 m/s"),
        ('"fast"', "syntax error: fast is no special value of SpeedValue; a number or unavailable is expected"),
        ("NaN", "a number is expected"),
        ('"\\ud800"', "an escape of JSON is expected"),
        ("[" * 10_000, "a number is expected"),
        ('1,"speedValue":2', "the member speedValue is there twice"),
    ],
)
def test_an_invalid_plain_number_is_refused_with_its_path(text: str, why: str):
    with pytest.raises(captain_messages.EncodeError) as caught:
        CAM.from_json(with_speed(text), plain=True)
    assert caught.value.path == SPEED
    assert why in caught.value.reason


@pytest.mark.parametrize("plain", [False, True])
def test_hostile_json_is_refused_with_its_path_in_bounded_memory(plain: bool):
    text = CAM.to_json(CAM_OCTETS, plain=plain)
    deep, long = "[" * 10_000, "x" * 50_000
    hostile = {
        f'{{"header":{{"protocolVersion":{deep}': "header.protocolVersion",
        text[:-1] + ',"header":{}}': "header",
        text.replace('"header"', f'"{long}"'): "",
        text.replace('"stationID":', '"stationID":9e999999999999999999'): "header.stationID",
        text.replace('"forward"', '"\\udfff"'): SPEED.replace("speed.speedValue", "driveDirection"),
        text.replace("{", '{"more":1,', 1): "",
    }
    tracemalloc.start()
    for bad, path in hostile.items():
        with pytest.raises(captain_messages.EncodeError) as caught:
            CAM.from_json(bad, plain=plain)
        assert caught.value.path == path
        assert len(str(caught.value)) < 1000
    assert tracemalloc.get_traced_memory()[1] < 1_000_000
    tracemalloc.stop()
    assert CAM.from_json(text, plain=plain) == CAM_OCTETS


def test_a_lone_surrogate_of_python_is_refused():
    for plain in (False, True):
        with pytest.raises(captain_messages.EncodeError, match="a lone surrogate"):
            CAM.from_json(PLAIN.replace("forward", "\ud800"), plain=plain)


def test_the_type_tree_holds_plain_ranges_and_special_values():
    speed: Any = CAM.type_tree()
    for name in SPEED.split("."):
        speed = next(field.type for field in speed.fields if field.name == name)
    assert speed.special == ("unavailable",)
    assert speed.plain_range(None) == ("0", "163.82", "m/s")
    assert speed.plain_range("km/h") == ("0", "4550.555555556", "m/s")
    assert CAM.type_tree().special == ()
    with pytest.raises(ValueError, match="is no INTEGER with a unit"):
        CAM.type_tree().plain_range(None)
    with pytest.raises(TypeError):
        speed.plain_range(1)
