"""Every edition against our own reference, and one of each message against other codecs; `make truth` has all of both."""

from pathlib import Path
from typing import Any

import asn1tools
import pytest

from asn1.model import types as t
from tests.asn1 import codec, tshark
from tests.asn1.backends.cmake.test_library import CPM_R2
from tests.asn1.bits import Bits
from tests.asn1.disagreements import TABLE
from tests.asn1.effective import effective
from tests.asn1.imported import snippet
from tests.asn1.older import UnsaidError, seen_by_older
from tests.asn1.oracles import Asn1tools, Pycrate
from tests.asn1.ranges import read_as
from tests.asn1.reach import pruned
from tests.asn1.reference import Encoder
from tests.asn1.trial import Tally, Trial, chunks, reads
from tests.asn1.truth import report, schema, tasks
from tests.asn1.values import Values

MESSAGES = sorted(schema().messages)
# The first edition of each message: the other codecs take a second to compile an edition.
FIRST = sorted({one.type: one.name for one in reversed(schema().messages.values())}.values())


def tried(name: str, count: int, **every: int) -> Tally:
    return Trial(schema(), schema().messages[name], codec.captain_messages.find(name), every).run(0, count)


@pytest.mark.parametrize("name", MESSAGES)
def test_octets_are_those_that_the_standard_demands_and_decode_to_the_value(name: str):
    tally = tried(name, 200)
    assert (tally.values, tally.unexplained) == (200, 0), tally.examples


@pytest.mark.parametrize("name", FIRST)
def test_asn1tools_agrees_but_for_what_is_known(name: str):
    tally = tried(name, 60, asn1tools=3)
    assert tally.agreed["asn1tools"] + tally.healed["asn1tools"] >= 15
    assert tally.unexplained == 0, tally.examples


@pytest.mark.parametrize("name", FIRST)
def test_pycrate_agrees_but_for_what_is_known(name: str):
    tally = tried(name, 40, pycrate=4)
    assert tally.agreed["pycrate"] + tally.healed["pycrate"] >= 6
    assert tally.unexplained == 0, tally.examples


@pytest.mark.parametrize("name", tshark.MESSAGES)
def test_tshark_reads_what_was_written_but_for_what_is_known(name: str):
    tally = tried(name, 60, tshark=2)
    assert tally.agreed["tshark"] > 0
    assert tally.unexplained == 0, tally.examples


@pytest.mark.parametrize(
    "octets", [one for _, one in codec.REAL if tshark.edition(one)], ids=lambda one: one.hex()[:12]
)
def test_tshark_reads_real_messages_as_we_do(octets: bytes, tmp_path: Path):
    name = tshark.edition(octets)
    assert name is not None
    message = schema().messages[name]
    (read,) = tshark.leaves_read(tmp_path / "real.pcap", [octets], message.btp_port)
    value = codec.captain_messages.find(name).decode(octets)
    assert tshark.is_same(read, tshark.leaves_written(schema(), message.pdu, value))


def test_of_the_real_messages_tshark_reads_all_of_an_edition_that_it_knows():
    assert {name for name, one in codec.REAL if tshark.edition(one)} >= {
        "cam-1.4.1", "denm-1.3.1", "spatem-2.1.1", "ivim-2.1.1", "cpm-tr-2.1.1",
    }  # fmt: skip


def test_messages_linked_into_one_library_do_not_disturb_each_other():
    # C types of one name and different code in several libraries: a DENM decodes "successfully" as something else.
    made = []
    for name in MESSAGES:
        message = schema().messages[name]
        pdu, read = message.pdu, read_as(pruned(schema(), message.pdu), message)
        values, encoder = Values(read, pdu, 9, is_long=False), Encoder(read)
        for _ in range(6):
            value = values.value()
            octets = encoder.encode(pdu, value)
            values.complete()
            made.append((codec.captain_messages.find(name), value, octets))
    for start in range(6):  # never two of one message in a row
        for message, value, octets in made[start::6]:
            assert message.decode(octets) == value
            assert message.encode(value) == octets


def test_an_older_receiver_sees_a_value_without_what_it_does_not_know():
    schema, root = snippet("Root ::= SEQUENCE { a BOOLEAN, ..., b ENUMERATED { c, ... } }", "Root")
    newer = {"a": True, "b": "c", "[2]": b"\x01", "[]": 3}
    assert seen_by_older(schema, root, newer) == {"a": True, "b": "c"}
    with pytest.raises(UnsaidError):
        seen_by_older(schema, root, {"a": True, "b": 1})


class Broken:
    """A codec with a fault, over one without."""

    def __init__(self, name: str, **faults: Any) -> None:
        whole = codec.captain_messages.find(name)
        self.encode = faults.get("encode", whole.encode)
        self.decode = faults.get("decode", whole.decode)


@pytest.mark.parametrize(
    "faults",
    [
        {"encode": lambda value: b"\x02\x02"},
        {"decode": lambda octets: {}},
    ],
)
def test_a_codec_with_a_fault_is_found_out(faults: dict[str, Any]):
    tally = Trial(schema(), schema().messages["cam-1.4.1"], Broken("cam-1.4.1", **faults), {}).run(0, 10)
    assert tally.unexplained == 10
    assert len(tally.examples) == 3


def test_a_long_bit_string_agrees_though_python_does_not_print_its_number():
    # pycrate's is an integer: 14285 bits are more than the 4300 digits that str() makes.
    schema, root = snippet("Root ::= BIT STRING (SIZE (0..15000))", "Root")
    pycrate, value = Pycrate(schema, root), (b"\xff" * 1785 + b"\xf8", 14285)
    assert reads(pycrate, value, pycrate.encode(pycrate.shape(value))).is_equal


def test_a_run_is_the_same_however_it_is_cut():
    assert list(chunks(25, 10)) == [(0, 10), (1, 10), (2, 5)]
    messages = [one for one in schema().messages.values() if one.type == "cam"]
    todo = list(tasks(messages, 30_000, {}))
    assert sum(one.values for one in todo) == 30_000
    assert {one.message for one in todo} == {one.name for one in messages}


def test_the_table_names_each_message_and_who_is_wrong_by_which_clause():
    tally = Tally(values=7)
    tally.differ("asn1tools", [TABLE[0].construct], "")
    tally.fail("cam-1.4.1: something else")
    lines = "\n".join(report({"cam-1.4.1": tally}, {"asn1tools": 10}))
    assert "cam-1.4.1" in lines
    assert f"asn1tools  {TABLE[0].construct} ({TABLE[0].clause}): {TABLE[0].who_is_wrong}" in lines
    assert "unexplained: cam-1.4.1: something else" in lines


# One container of up to eight: its identifier, 2 of 1..16, and an open type of one octet, in which nothing is set.
CONTAINERS = "000" + "0001" + "00000001" + "00000000"


def test_where_a_serial_constraint_ends_without_a_marker_there_is_no_extension_bit():
    """X.680 50.11: ConstraintWrappedCpmContainers, WrappedCpmContainers (WITH COMPONENT ...), is not extensible.

    asn1c and Wireshark 4.4 decide so as well; asn1tools, pycrate and rasn leave the parent its extension bit.
    """
    value = _least_cpm()
    containers = value["payload"]["cpmContainers"]
    pdu, cpm = schema().messages["cpm-2.1.1"].pdu, "r2_cpm211"
    assert _bits(t.Reference(cpm, "WrappedCpmContainers"), containers) == "0" + CONTAINERS
    assert _bits(t.Reference(cpm, "ConstraintWrappedCpmContainers"), containers) == CONTAINERS
    assert _bits(pdu, value).endswith(CONTAINERS)
    octets = codec.captain_messages.find("cpm-2.1.1").encode(value)
    assert octets == Encoder(schema()).encode(pdu, value)
    assert codec.captain_messages.find("cpm-2.1.1").decode(octets) == value
    theirs = Asn1tools(pruned(schema(), pdu), pdu)
    assert theirs.encode(theirs.shape(value)) != octets


def test_asn1tools_reads_a_cpm_as_soon_as_its_constraints_are_written_out():
    pdu, octets = schema().messages["cpm-2.1.1"].pdu, bytes.fromhex(CPM_R2)
    theirs, healed = (Asn1tools(one, pdu) for one in (pruned(schema(), pdu), effective(pruned(schema(), pdu))))
    with pytest.raises(asn1tools.DecodeError):
        theirs.decode(octets)
    assert healed.decode(octets) == healed.shape(codec.captain_messages.find("cpm-2.1.1").decode(octets))


def test_tshark_sees_no_extension_bit_where_it_knows_the_cpm(tmp_path: Path):
    # Wireshark 4.0 knows no message with such a constraint: it reads the header of a CPM of TS 103 324, and its octets.
    ours, theirs = (codec.captain_messages.find(name).encode(_least_cpm()) for name in ("cpm-2.1.1", "cpm-2.1.1-ext"))
    read = tshark.leaves_read(tmp_path / "cpm.pcap", [ours, theirs], 2009)
    written = tshark.leaves_written(schema(), schema().messages["cpm-2.1.1"].pdu, _least_cpm())
    assert [tshark.is_same(one, written) for one in read] == [tshark.KNOWS_RELEASE_2, False]
    if not tshark.KNOWS_RELEASE_2:
        assert all(one is not None and one[:3] == written[:3] and len(one) < 6 for one in read)


def _least_cpm() -> dict[str, Any]:
    pdu = schema().messages["cpm-2.1.1"].pdu
    value: dict[str, Any] = Values(schema(), pdu, 1, knows_more=False).value()
    value["header"] = {"protocolVersion": 2, "messageId": 14, "stationId": 1}
    value["payload"]["cpmContainers"] = [{"containerId": 2, "containerData": {}}]
    return value


def _bits(type_: t.Type, value: Any) -> str:
    bits = Bits()
    Encoder(schema()).encoder(type_)(bits, value)
    return f"{bits.value:0{bits.count}b}"
