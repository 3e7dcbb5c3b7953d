"""JSON schemas of both dialects: they accept what the library writes, and refuse what it refuses."""

import json
import random
from typing import Any

import jsonschema
import pytest

from firmware.codec.schema import DRAFT, schema
from tests.asn1.codec import CAM, CAM_OCTETS, captain_messages
from tests.firmware.codec import dialects
from tests.firmware.codec.mutations import mutations

EDITIONS = dialects.editions()
VALUES = 5  # of each edition; `make dialects` takes thousands
MUTATIONS = 8
MAX_TEXT = 3000  # characters; jsonschema takes 10 ms for them


def test_every_edition_with_a_header_is_there():
    assert len(EDITIONS) >= 30
    assert {"cam-1.4.1", "denm-2.3.1", "cpm-2.1.1", "ivim-2.2.1", "spatem-2.1.1", "vam-2.3.1"} <= set(EDITIONS)


@pytest.mark.parametrize("edition", EDITIONS)
def test_a_generated_value_comes_back_and_fits_both_schemas(edition: str):
    assert dialects.failures(dialects.Task(edition, 3, VALUES, VALUES)) == (edition, [])


@pytest.mark.parametrize("edition", EDITIONS)
@pytest.mark.parametrize("is_plain", [False, True])
def test_a_schema_refuses_exactly_the_mutations_that_the_library_refuses(edition: str, is_plain: bool):
    codec, fits = captain_messages.find(edition), dialects.validator(edition, is_plain)
    texts = (codec.to_json(one, plain=is_plain) for one in dialects.octets_of(edition, 11, 40, is_long=False))
    value = json.loads(next(text for text in texts if len(text) < MAX_TEXT))
    changed = list(mutations(value))
    for one in random.Random(1).sample(changed, min(MUTATIONS, len(changed))):
        try:
            codec.from_json(json.dumps(one.value), plain=is_plain)
            is_refused = False
        except captain_messages.EncodeError:
            is_refused = True
        assert fits.is_valid({"edition": edition, "message": one.value}) != is_refused, (one.what, one.path)


@pytest.mark.parametrize("edition", EDITIONS)
@pytest.mark.parametrize("is_plain", [False, True])
def test_example_of_each_edition_fits_both_schemas(edition: str, is_plain: bool):
    message = captain_messages.find(edition)
    text = message.to_json(message.encode(message.example()), plain=is_plain)
    dialects.validator(edition, is_plain).validate({"edition": edition, "message": json.loads(text)})


def leaf(is_plain: bool, path: str) -> Any:
    """The schema of a component of the CAM."""
    whole = schema(CAM, is_plain)
    definitions: Any = whole["$defs"]
    found: Any = {"$ref": "#/$defs/CAM"}
    for name in path.split("."):
        found = definitions[found["$ref"].rpartition("/")[2]]["properties"][name]
    return definitions[found["$ref"].rpartition("/")[2]] if "$ref" in found else found


HIGH = "cam.camParameters.highFrequencyContainer.basicVehicleContainerHighFrequency"


def test_a_number_of_the_exact_dialect_has_the_range_and_unit_of_the_standard():
    speed = {"type": "integer", "minimum": 0, "maximum": 16383, "description": "in 0.01 m/s"}
    assert leaf(False, f"{HIGH}.speed.speedValue") == speed


def test_a_number_of_the_plain_dialect_has_an_si_range_and_names_of_special_values():
    number = {"type": "number", "minimum": 0, "maximum": 163.82, "description": "in m/s"}
    assert leaf(True, f"{HIGH}.speed.speedValue") == {"anyOf": [number, {"enum": ["unavailable"]}]}


def test_bits_of_the_plain_dialect_are_a_list_of_names():
    assert leaf(False, f"{HIGH}.accelerationControl") == {"type": "string", "pattern": "^(?:[0-9A-Fa-f]{2}){1}$"}
    bits = leaf(True, f"{HIGH}.accelerationControl")
    assert bits["uniqueItems"]
    assert "brakePedalEngaged" in bits["items"]["anyOf"][0]["enum"]


def test_a_schema_names_its_draft_and_edition():
    whole = schema(CAM, is_plain=False)
    assert whole["$schema"] == DRAFT == "https://json-schema.org/draft/2020-12/schema"
    fits = dialects.validator("cam-1.4.1", is_plain=False)
    message = json.loads(CAM.to_json(CAM_OCTETS))
    assert fits.is_valid({"edition": "cam-1.4.1", "form": "json", "why": "decode adds it", "message": message})
    for wrong in (
        {"edition": "cam-1.3.2", "message": message},
        {"message": message},
        {"edition": "cam-1.4.1"},
        message,
    ):
        assert not fits.is_valid(wrong)
    assert not fits.is_valid({"edition": "cam-1.4.1", "form": "plain", "message": message})


@pytest.mark.parametrize("is_plain", [False, True])
def test_octets_of_an_unknown_open_type_beside_numbers_fit_the_schema(is_plain: bool):
    whole = schema(captain_messages.find("ivim-2.2.1"), is_plain)
    item = jsonschema.Draft202012Validator({"$defs": whole["$defs"], "$ref": "#/$defs/SupportItem"})
    assert item.is_valid({"id": 9, "content": "38B8"})
    assert not item.is_valid({"id": 9, "content": "text"})
