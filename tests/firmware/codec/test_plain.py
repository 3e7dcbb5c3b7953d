"""The plain dialect on the command line: decode --plain, encode with "form" and --plain, encode --schema."""

import json
from typing import Any

import jsonschema
import pytest

from board.runtime.errors import RequestError
from firmware import cli
from firmware.codec import encoding
from firmware.codec.decoding import Decoder, record
from firmware.codec.library import load
from firmware.codec.reading import Object, Pdu
from tests.asn1.codec import CAM_OCTETS, REAL
from tests.said import tells

ALL = sorted(load().all(), key=lambda message: message.rank)
WISH = encoding.Wish(ALL, None, ALL)


@pytest.fixture(scope="module")
def decoder() -> Decoder:
    return Decoder(load())


@pytest.mark.parametrize(("_", "octets"), REAL)
def test_a_real_message_in_plain_encodes_to_the_same_octets(decoder: Decoder, _: str, octets: bytes):
    found = decoder.identify(Pdu(octets, "here"))
    value = json.loads(record(Pdu(octets, "here"), found, is_plain=True))
    assert value["form"] == "plain"
    assert encoding.encode(Object(value, "here"), WISH).octets == octets


def test_an_object_without_form_is_plain_only_if_the_user_asks_for_it(decoder: Decoder):
    found = decoder.identify(Pdu(CAM_OCTETS, "here"))
    plain: Any = json.loads(record(Pdu(CAM_OCTETS, "here"), found, is_plain=True))
    del plain["form"]
    asked = WISH._replace(is_plain=True)
    assert encoding.encode(Object(plain, "here"), asked).octets == CAM_OCTETS
    assert encoding.encode(Object(plain["message"], "here"), asked).octets == CAM_OCTETS
    with pytest.raises(RequestError, match="a whole number is expected"):
        encoding.encode(Object(plain, "here"), WISH)
    exact = json.loads(record(Pdu(CAM_OCTETS, "here"), found)) | {"form": "json"}
    assert encoding.encode(Object(exact, "here"), asked).octets == CAM_OCTETS


@pytest.mark.parametrize("form", ["si", 7, ["plain"]])
def test_message_of_an_unknown_form_is_refused_with_the_known_ones(form: object):
    value: dict[str, object] = {"edition": "cam-1.4.1", "form": form, "message": {}}
    with pytest.raises(RequestError, match="here: form: unknown form") as caught:
        encoding.encode(Object(value, "here"), WISH)
    assert tells(caught.value.hint, "json", "plain")


def test_decode_plain_and_encode_give_the_same_octets(capsys: pytest.CaptureFixture[str]):
    assert cli.main(["decode", "--plain", CAM_OCTETS.hex()]) == 0
    text = capsys.readouterr().out
    assert json.loads(text)["message"]["cam"]["generationDeltaTime"] < 66
    assert cli.main(["encode", text]) == 0
    assert capsys.readouterr().out == f"{CAM_OCTETS.hex()}\n"
    assert cli.main(["encode", "--plain", json.dumps(json.loads(text)["message"])]) == 0
    assert capsys.readouterr().out == f"{CAM_OCTETS.hex()}\n"


@pytest.mark.parametrize("options", [[], ["--plain"]])
def test_encode_schema_accepts_what_decode_prints(capsys: pytest.CaptureFixture[str], options: list[str]):
    assert cli.main(["encode", "--schema", "cam", *options]) == 0
    schema = json.loads(capsys.readouterr().out)
    assert cli.main(["decode", *(options or ["--json"]), CAM_OCTETS.hex()]) == 0
    jsonschema.validate(json.loads(capsys.readouterr().out), schema)


def test_encode_schema_of_an_unknown_edition_names_a_known_one(capsys: pytest.CaptureFixture[str]):
    assert cli.main(["encode", "--schema", "camm"]) == 1
    assert tells(capsys.readouterr().err, "captain: --schema: ", "'camm'", "cam?")
