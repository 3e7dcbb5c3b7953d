"""captain_messages: what a newer sender says is kept, shown, and encoded again."""

import pytest

from tests.asn1.codec import CAM, CAM_OCTETS, captain_messages

EncodeError = captain_messages.EncodeError


def basic(**newer):
    """A CAM whose BasicContainer, which knows no additions, has some."""
    value = CAM.decode(CAM_OCTETS)
    value["cam"]["camParameters"]["basicContainer"].update(newer)
    return value


def container_of(octets):
    return CAM.decode(octets)["cam"]["camParameters"]["basicContainer"]


def test_an_unknown_addition_is_a_key_with_its_number():
    octets = CAM.encode(basic(**{"[0]": b"\x01\x02"}))
    assert container_of(octets)["[0]"] == b"\x01\x02"
    assert container_of(octets)["[]"] == 1
    assert CAM.encode(CAM.decode(octets)) == octets
    assert CAM.encode(CAM.view(octets)) == octets
    assert CAM.from_json(CAM.to_json(octets)) == octets


def test_the_length_of_the_bitmap_is_kept():
    octets = CAM.encode(basic(**{"[1]": b"\x07", "[]": 6}))
    assert {key: value for key, value in container_of(octets).items() if key[0] == "["} == {"[1]": b"\x07", "[]": 6}
    assert CAM.encode(CAM.decode(octets)) == octets
    assert octets != CAM.encode(basic(**{"[1]": b"\x07"}))


def test_additions_may_come_in_any_order():
    newer = {"[5]": b"\x05", "[]": 9, "[2]": b"\x02"}
    octets = CAM.encode(basic(**newer))
    assert CAM.encode(basic(**dict(reversed(newer.items())))) == octets
    assert [key for key in container_of(octets) if key[0] == "["] == ["[2]", "[5]", "[]"]


def test_an_addition_makes_a_message_another():
    plain, newer = CAM.view(CAM_OCTETS), CAM.view(CAM.encode(basic(**{"[0]": b"\x01"})))
    assert plain != newer
    assert plain.header == newer.header


@pytest.mark.parametrize(
    "newer",
    [
        {"[0]": "text"},
        {"[0]": None},
        {"[00]": b"x"},
        {"[-1]": b"x"},
        {"[65536]": b"x"},
        {"[": b"x"},
        {"[]": 0},
        {"[]": "6"},
        {"[]": 1.5},
        {"[]": 2**80},
        {"[]": 16384},
        {"[3]": b"x", "[]": 3},
    ],
    ids=str,
)
def test_what_is_no_addition_is_refused(newer):
    with pytest.raises(EncodeError) as caught:
        CAM.encode(basic(**newer))
    assert caught.value.path.startswith("cam.camParameters.basicContainer")


def test_an_unknown_alternative_is_a_pair_of_number_and_octets():
    value = CAM.decode(CAM_OCTETS)
    value["cam"]["camParameters"]["highFrequencyContainer"] = ("[1]", b"\xca\xfe")
    octets = CAM.encode(value)
    assert CAM.decode(octets) == value
    view = CAM.view(octets).cam.camParameters.highFrequencyContainer
    assert (view.choice, view.value, view.to_dict()) == ("[1]", b"\xca\xfe", ("[1]", b"\xca\xfe"))
    assert CAM.encode(CAM.view(octets)) == octets


@pytest.mark.parametrize("index", [65536, 2**30 - 1])
def test_an_index_may_be_as_large_as_decode_gives_it(index):
    value = CAM.decode(CAM_OCTETS)
    value["cam"]["camParameters"]["highFrequencyContainer"] = (f"[{index}]", b"\xca\xfe")
    assert CAM.decode(CAM.encode(value)) == value
    ssem, status = captain_messages.find("ssem"), _ssem(index)
    assert ssem.decode(ssem.encode(status)) == status


@pytest.mark.parametrize("index", [2**30, 2**32 + 5, 10**20])
def test_a_larger_index_is_refused(index):
    value = CAM.decode(CAM_OCTETS)
    value["cam"]["camParameters"]["highFrequencyContainer"] = (f"[{index}]", b"\xca\xfe")
    with pytest.raises(EncodeError, match="is no alternative"):
        CAM.encode(value)
    with pytest.raises(EncodeError, match="is no index of an unknown item"):
        captain_messages.find("ssem").encode(_ssem(index))


def test_an_unknown_item_is_the_number_of_its_addition():
    ssem = captain_messages.find("ssem")
    kinds = []

    def look(kind, path):
        if kind.kind == "ENUMERATED" and kind.is_extensible:
            kinds.append((path, kind))
        for field in kind.fields:
            look(field.type, (*path, field.name))
        if kind.element is not None:
            look(kind.element, (*path, 0))

    look(ssem.type_tree(), ())
    path, kind = next((path, kind) for path, kind in kinds if kind.name == "PrioritizationResponseStatus")
    assert path[-1] == "status"
    value = _ssem(3)
    assert ssem.decode(ssem.encode(value)) == value
    value["ssm"]["status"][0]["sigStatus"] = [_status("processing")]
    assert ssem.decode(ssem.encode(value)) == value
    assert "processing" in dict(kind.names)
    for wrong in (-1, 2**40, True, 1.0):
        value["ssm"]["status"][0]["sigStatus"] = [_status(wrong)]
        with pytest.raises(EncodeError) as caught:
            ssem.encode(value)
        assert caught.value.path == "ssm.status[0].sigStatus[0].status"


def _ssem(status):
    return {
        "header": {"protocolVersion": 1, "messageID": 10, "stationID": 1},
        "ssm": {"second": 0, "status": [{"sequenceNumber": 0, "id": {"id": 1}, "sigStatus": [_status(status)]}]},
    }


def _status(status):
    return {"inboundOn": ("lane", 1), "status": status}


@pytest.mark.parametrize("length", [0, 16384, 65536])
def test_the_length_of_a_bitmap_is_told_as_it_is_taken(length):
    assert CAM.encode(basic(**{"[]": 16383}))
    with pytest.raises(EncodeError, match=r"the length of a bitmap is an int in 1\.\.16383"):
        CAM.encode(basic(**{"[]": length}))
