"""CPMs of TS 103 324 with and without the extension bit of cpmContainers, and every other place of that kind."""

import json
from pathlib import Path

import captain_messages
import pytest

from asn1.layout.layout import lay_out
from asn1.model.forms import touched
from asn1.model.text import load_schema
from board.runtime.errors import RequestError
from drivers.mqtt.profile import MessageLibrary, codec, load
from drivers.wire.v2n.profile import Delivery, Identity, Profile
from firmware.codec import library
from firmware.codec.decoding import Decoder, record
from firmware.codec.encoding import Wish, encode
from firmware.codec.reading import Object, Pdu
from firmware.commands import decode as decode_command
from firmware.gateway.captain_gateway.captain_gateway.codec import Edition
from firmware.gateway.captain_gateway.captain_gateway.handlers import KINDS
from firmware.gateway.captain_gateway.captain_gateway.routing import Routing
from firmware.recorder.mcap_recording import topic_names
from tests.drivers.wire.v2n.payload.nap import CPM, sent
from tests.firmware.gateway.library import Library

HERE = Path(__file__).parent
LINES = (HERE / "cpm-extension-bit.hex").read_text().splitlines()
CPMS = [bytes.fromhex(line) for line in LINES if not line.startswith("#")]
STRICT, FORM = (captain_messages.find(name) for name in ("cpm-2.1.1", "cpm-2.1.1-ext"))
SCHEMA = load_schema()


def shown(octets: bytes, edition: str | None = None) -> dict[str, object]:
    """What `captain decode --json` prints."""
    pdu = Pdu(octets, "a test")
    return json.loads(record(pdu, Decoder(library.load(), edition).identify(pdu)))


def wish(asked: str | None = None) -> Wish:
    loaded = library.load()
    return Wish(library.editions(loaded, asked), asked, loaded.all())


def test_the_nine_cpms_are_there():
    assert len(CPMS) == 9


@pytest.mark.parametrize("octets", CPMS)
def test_a_cpm_with_the_extension_bit_decodes_encodes_to_the_same_octets_and_names_both_forms(octets: bytes):
    told = shown(octets)
    assert told["edition"] == "cpm-2.1.1-ext"
    assert told["candidates"] == ["cpm-2.1.1-ext"]
    assert "cpm-2.1.1 does not decode" in str(told["why"])
    assert FORM.encode(FORM.decode(octets)) == octets
    assert encode(Object(told, "a test"), wish()) == (FORM, octets, "")


@pytest.mark.parametrize("octets", CPMS)
def test_the_same_cpm_without_the_bit_decodes_and_names_both_forms(octets: bytes):
    strict = STRICT.encode(FORM.decode(octets))
    told = shown(strict)
    assert told["edition"] == "cpm-2.1.1"
    assert str(told["why"]).endswith("the form cpm-2.1.1-ext (with extension bit) does not decode")
    assert told["message"] == shown(octets)["message"]


@pytest.mark.parametrize("octets", CPMS)
@pytest.mark.parametrize("asked", ["cpm-2.1.1", "cpm-2.1.1-ext"])
def test_an_object_of_either_form_is_encoded_in_the_form_that_is_asked_for(octets: bytes, asked: str):
    expected = {"cpm-2.1.1": STRICT.encode(FORM.decode(octets)), "cpm-2.1.1-ext": octets}
    for source in expected.values():
        made = encode(Object(shown(source), "a test"), wish(asked))
        assert (made.message.name, made.octets) == (asked, expected[asked])


def test_an_object_without_edition_is_encoded_in_the_strict_form_whatever_that_refuses():
    value = STRICT.decode(STRICT.encode(FORM.decode(CPMS[1])))
    text = json.loads(STRICT.to_json(STRICT.encode(value)))
    assert encode(Object(text, "a test"), wish()).message is STRICT
    text["payload"]["cpmContainers"] *= 5  # 10 of 1..8
    with pytest.raises(RequestError, match=r"cpm-2\.1\.1: .*10 elements"):
        encode(Object(text, "a test"), wish("cpm"))
    assert encode(Object(text, "a test"), wish("cpm-2.1.1-ext")).message is FORM


def test_decode_explain_and_list_tell_the_form(capsys: pytest.CaptureFixture[str]):
    from firmware import cli

    for command in (["decode"], ["explain"]):
        assert cli.main([*command, CPMS[1].hex()]) == 0
        out = capsys.readouterr().out
        assert "cpm-2.1.1-ext: ETSI TS 103 324 v2.1.1, with the extension bit of cpmContainers, 44 octets" in out
    decode_command._list(library.editions(library.load(), "cpm"), is_json=False)
    assert capsys.readouterr().out.count("cpm-2.1.1") == 2


# ---------------------------------------------------------------- V2N, ROS 2, recordings


def nap(*editions: str) -> Profile:
    description = load("nap")
    return Profile(description, Identity("h", 7, "u", ""), codec(description, editions))


@pytest.mark.parametrize(("editions", "message"), [((), STRICT), (("cpm-2.1.1-ext",), FORM)])
def test_json_of_a_broker_is_encoded_in_the_form_of_captain_toml(editions: tuple[str, ...], message: object):
    pdu = nap(*editions).receive(Delivery("vanetza/in/cpm", json.dumps(CPM).encode())).pdu
    assert message.encode(message.decode(pdu)) == pdu  # type: ignore[attr-defined]
    assert pdu[6:] == FORM.encode(STRICT.decode(sent("cpm", CPM)))[6:] if editions else pdu == sent("cpm", CPM)


def test_a_cpm_with_the_bit_goes_to_a_broker_as_json():
    decodings = list(MessageLibrary(captain_messages.all()).decodings(CPMS[3]))
    assert [(edition.name, value) for edition, value in decodings] == [("cpm-2.1.1-ext", FORM.decode(CPMS[3]))]


def test_both_forms_have_one_topic_in_recordings_and_one_handler_in_the_gateway():
    names = topic_names(library.load())
    assert names["cpm-2.1.1"] == names["cpm-2.1.1-ext"] == "cpm"
    handler = Edition(Library(), "cpm-2.1.1", "etsi_its", KINDS["cpm"])
    strict = STRICT.encode(FORM.decode(CPMS[0]))
    assert [handler.of(octets).name for octets in (CPMS[0], strict, b"\2\x0e" + bytes(9))] == [
        "cpm-2.1.1-ext", "cpm-2.1.1", "cpm-2.1.1",
    ]  # fmt: skip
    tr = Edition(Library(), "cpm-tr-2.1.1", "etsi_its", KINDS["cpm_tr"])
    one, other = (type("Handler", (), {"edition": edition})() for edition in (tr, handler))
    assert Routing([one, other]).find(CPMS[0]) is other


# ---------------------------------------------------------------- every place of the kind

# As the table in asn1/guide/editions.md: PDU, the type and component where a serial constraint takes the marker, root.
PLACES = {
    "cam-2.3.1": {("r2_cam231_WrappedExtensionContainer_containerId", 1, 16), ("r2_cdd241_PathPredicted2_pathPredicted", 1, 16)},
    "cpm-2.1.1": {("r2_cpm211_ConstraintWrappedCpmContainers", 1, 8)},
    "denm-2.2.1": {("r2_cdd221_PathPredicted2_pathPredicted", 1, 16)},
    "denm-2.3.1": {("r2_cdd241_PathPredicted2_pathPredicted", 1, 16)},
    "ivim-2.2.1": {("r2_ivi221_SupportItem_id", 0, 127)},
    "poi-2.1.1": {("r2_poim211_WrappedPoiInformationBlock_poiType", 1, 128)},
}  # fmt: skip


def test_the_places_of_all_messages_where_a_serial_constraint_takes_a_marker_are_known():
    found: dict[str, set[tuple[str, int | None, int | None]]] = {}
    for name, message in SCHEMA.messages.items():
        if not message.form_of:
            nodes = [node for of_module in lay_out(SCHEMA, [message]).nodes.values() for node in of_module]
            lost = {node for node in touched(nodes) if node.bounds.lost_marker}
            found |= {name: {(node.c_name, node.bounds.low, node.bounds.high) for node in lost}} if lost else {}
    assert found == PLACES


def test_each_of_them_has_an_ext_form_and_a_row_in_the_guide():
    assert {message.form_of for message in SCHEMA.messages.values() if message.form_of} == set(PLACES)
    guide = (HERE.parents[1] / "asn1/guide/editions.md").read_text()
    for name in PLACES:
        assert f"`{name}-ext`" in guide
