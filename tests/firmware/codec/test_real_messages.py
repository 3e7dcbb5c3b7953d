"""Real messages through the real library: firmware/vectors.json, and the frames of an independent station."""

import io
import json
import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import firmware
from board.runtime.errors import RequestError
from firmware.codec import bits, encoding, fields, showing
from firmware.codec.decoding import Decoder, UndecodableError, error_record, record
from firmware.codec.library import load
from firmware.codec.reading import Object, Pdu, Reader
from tests.firmware.recordings.test_layers import FRAMES
from tests.said import tells

VECTORS = json.loads((Path(firmware.__file__).parent / "vectors.json").read_text())
PDUS = [bytes.fromhex(row["hex"]) for row in VECTORS]
CAM = next(pdu for pdu in PDUS if len(pdu) == 46)
DENM = PDUS[0]

ALL = sorted(load().all(), key=lambda message: message.rank)
WISH = encoding.Wish(ALL, None, ALL)

# CONTRACT of the RawRxMessage: sec 1795182426, usec 461613, rssi -71, around the PDU 02020000053900010203.
RAW = bytes.fromhex(
    "7ac013d6a001c2cb5fee400300804000000000000000000000000000000000000000000000000000000000000000000000002703"
    "23aa224dc09000000000000000102030405060140240808000014e40004080c0"
)


@pytest.fixture(scope="module")
def decoder() -> Decoder:
    return Decoder(load())


@pytest.mark.parametrize("row", VECTORS, ids=lambda row: f"{row['type']}-{row['octets']}")
def test_a_real_message_is_known_by_type_and_gives_the_same_octets_back(decoder, row):
    pdu = Pdu(bytes.fromhex(row["hex"]), "here")
    found = decoder.identify(pdu)
    assert found.message.type == row["type"]
    assert found.is_exact
    text = record(pdu, found)
    assert text.isascii()
    made = encoding.encode(Object(json.loads(text), "here"), WISH)
    assert (made.message, made.octets) == (found.message, pdu.octets)
    assert bool(made.warning) == bool(found.doubt)


@pytest.mark.parametrize("pdu", PDUS, ids=len)
def test_every_candidate_gives_the_same_octets_back(decoder, pdu):
    found = decoder.identify(Pdu(pdu, "here"))
    for message in found.exact:
        assert Decoder(load(), message.name).identify(Pdu(pdu, "here")).is_exact


@pytest.mark.parametrize("pdu", PDUS, ids=len)
def test_the_tree_has_a_line_for_every_value(decoder, pdu):
    found = decoder.identify(Pdu(pdu, "here"))
    tree = showing.tree(Pdu(pdu, "here"), found, 80)
    values = [step for step in found.message.explain(pdu) if step.what == "value"]
    assert len(tree.splitlines()) >= len(values)


@pytest.mark.parametrize("pdu", PDUS, ids=len)
def test_explain_accounts_for_every_bit_in_its_order(decoder, pdu):
    steps = decoder.identify(Pdu(pdu, "here")).message.explain(pdu)
    rows = [row for row in bits.rows(pdu, steps) if row.width]
    assert [row.bit for row in rows] == [0, *(row.bit + row.width for row in rows[:-1])]
    assert rows[-1].bit + rows[-1].width == 8 * len(pdu)
    assert min(row.depth for row in rows) >= 0


@pytest.mark.parametrize("pdu", PDUS, ids=len)
@pytest.mark.parametrize("kept", [0.3, 0.6, 0.9])
def test_a_message_that_was_cut_off_is_truncated(decoder, pdu, kept):
    size = max(7, int(len(pdu) * kept))
    with pytest.raises(UndecodableError) as told:
        decoder.identify(Pdu(pdu[:size], "here"))
    assert "it is truncated: its " in told.value.hint
    assert told.value.nearest is not None
    assert told.value.nearest.bit <= 8 * size
    message = told.value.nearest.message
    assert list(bits.rows(pdu[:size], message.explain(pdu[:size]))), "what goes before is explained"


def test_octets_behind_a_message_are_told(decoder):
    with pytest.raises(UndecodableError, match="here: ") as told:
        decoder.identify(Pdu(CAM + bytes(7), "here"))
    assert told.value.hint.startswith("7 octets follow the 46 of the message")


def test_message_behind_its_btp_header_is_refused_with_the_port(decoder):
    with pytest.raises(UndecodableError) as told:
        decoder.identify(Pdu(bytes.fromhex("07d10000") + CAM, "here"))
    assert tells(told.value.hint, "BTP header", "port 2001")


def test_raw_message_of_a_station_is_found_by_trial(decoder):
    found = decoder.identify(Pdu(RAW, "here"))
    assert found.message.type == "rawrx"
    assert tells(found.why, "guess", "not an ITS PDU header")


def test_a_vam_with_the_legacy_number_is_a_vam(decoder):
    vam = next(pdu for pdu in PDUS if pdu[1] == 16)
    assert decoder.identify(Pdu(vam[:1] + b"\x66" + vam[2:], "here")).message.type == "vam"


def test_message_of_another_type_than_asked_for_is_refused_with_its_editions(decoder):
    with pytest.raises(UndecodableError) as told:
        Decoder(load(), "denm").identify(Pdu(CAM, "here"))
    assert tells(told.value.message, "messageID 2 ", "protocolVersion 2 ", "cam-1.4.1, cam-2.3.1 and cam-2.1.1")
    assert "cam-1.4.1" in told.value.hint


def test_a_cam_at_a_glance(decoder):
    message = decoder.identify(Pdu(CAM, "here")).message
    latitude, longitude, *rest = fields.glance(message, CAM).split()
    value = message.decode(CAM)
    place = value["cam"]["camParameters"]["basicContainer"]["referencePosition"]
    assert float(latitude) == round(place["latitude"] / 1e7, 5)
    assert float(longitude) == round(place["longitude"] / 1e7, 5)
    assert "m/s" in rest


def test_a_denm_at_a_glance(decoder):
    message = decoder.identify(Pdu(DENM, "here")).message
    assert fields.glance(message, DENM).startswith("roadworks/")


@pytest.mark.parametrize("pdu", PDUS, ids=len)
def test_every_message_has_a_glance_on_one_line(decoder, pdu):
    said = fields.glance(decoder.identify(Pdu(pdu, "here")).message, pdu)
    assert len(said.splitlines()) <= 1
    assert len(said) < 80


def test_a_field_has_its_unit(decoder):
    found = decoder.identify(Pdu(CAM, "here")).message
    (speed,) = fields.chosen(found.explain(CAM), ["speedValue"]).values()
    assert re.fullmatch(r"\d+ \(\d+\.\d\d m/s\)", speed)


@pytest.mark.parametrize("name", [name for name in FRAMES if name != "hello-shb"])
def test_the_frames_of_an_independent_station_hold_cams(decoder, name):
    (pdu,) = Reader(None, io.BytesIO()).read([FRAMES[name].hex()])
    assert decoder.identify(pdu).message.type == "cam"


def test_frame_without_a_message_is_refused_as_truncated(decoder):
    (pdu,) = Reader(None, io.BytesIO()).read([FRAMES["hello-shb"].hex()])
    with pytest.raises(UndecodableError) as told:
        decoder.identify(pdu)
    assert tells(told.value.hint, "truncated", "3 octets", "header")


@given(st.sampled_from(PDUS), st.integers(0, 10_000), st.integers(0, 255))
def test_a_message_with_one_wrong_octet_is_something_or_explained(decoder, pdu, at, octet):
    at %= len(pdu)
    explained(decoder, pdu[:at] + bytes((octet,)) + pdu[at + 1 :])


@given(st.binary(max_size=80), st.integers(1, 20), st.integers(1, 3))
def test_random_octets_behind_a_header_are_something_or_explained(decoder, body, number, version):
    explained(decoder, bytes((version, number)) + body)


def explained(decoder: Decoder, octets: bytes) -> None:
    pdu = Pdu(octets, "here")
    try:
        found = decoder.identify(pdu)
    except UndecodableError as error:
        assert json.dumps(error_record(error))
        assert error.hint
        message = error.nearest.message if error.nearest is not None else None
    else:
        message = found.message
        assert record(pdu, found).isascii()
        assert showing.tree(pdu, found, 80).replace("\n", "").isprintable()
        assert fields.glance(message, octets).isprintable()
    if message is not None:
        assert list(bits.rows(octets, message.explain(octets))) is not None


ANYTHING = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=6,
)


@given(ANYTHING, st.lists(st.integers(0, 30), max_size=6))
def test_any_value_in_place_of_another_is_encoded_or_refused_with_its_path(decoder, value, way):
    found = decoder.identify(Pdu(DENM, "here"))
    whole = json.loads(record(Pdu(DENM, "here"), found))
    put(whole["message"], way, value)
    try:
        octets = encoding.encode(Object(whole, "here"), WISH).octets
    except RequestError as error:
        assert error.message.startswith("here: denm-1.3.1: ")
    else:
        found.message.decode(octets)


def put(tree: object, way: list[int], value: object) -> None:
    """Replace what lies at the end of a way through a tree."""
    for at, step in enumerate(way):
        keys = list(tree) if isinstance(tree, dict) else list(range(len(tree))) if isinstance(tree, list) else []
        if not keys:
            return
        key = keys[step % len(keys)]
        if at == len(way) - 1 or not isinstance(tree[key], dict | list):
            tree[key] = value
            return
        tree = tree[key]
