"""The -ext form of a message: which types it lays out again, and what both have in common."""

import captain_messages
import pytest

from asn1.backends.c.library import write
from asn1.backends.docs import pages
from asn1.backends.ros2 import profiles
from asn1.layout.layout import Kind, Layout, Node, lay_out
from asn1.model.constraints import Bounds
from asn1.model.forms import touched
from asn1.model.text import load_schema
from asn1.model.types import Message
from tests.asn1.compiled import schema_of
from tests.asn1.ranges import read_as
from tests.asn1.reach import pruned
from tests.asn1.reference import Encoder
from tests.said import tells

SCHEMA = load_schema()
FORMS = {name: message for name, message in SCHEMA.messages.items() if message.form_of}
BODY = """
A ::= SEQUENCE { b B, c C (WITH COMPONENT (0..3)), d INTEGER (0..9, ...) (2..5) }
B ::= SEQUENCE { e INTEGER (0..9) }
C ::= SEQUENCE (SIZE (1..8, ...)) OF INTEGER (0..9)
"""


def laid_out() -> Layout:
    """A, and A in the -ext form."""
    schema = schema_of(BODY, "A")
    message = schema.messages["A"]
    form = Message("A-ext", "a", 1, "test", message.pdu, (), (), 0, 2, form_of="A")
    return lay_out(schema, [message, form])


def test_a_form_lays_out_again_what_holds_a_lost_marker_and_nothing_else():
    made = [node for nodes in laid_out().nodes.values() for node in nodes if node.form_of]
    assert {node.c_name for node in made} == {"m_A_ext", "m_A_c_ext", "m_A_d_ext"}


def test_a_form_has_the_extension_bits_and_the_structs_of_its_message():
    strict, form = (laid_out().pdus[name] for name in ("A", "A-ext"))
    assert [f.node.is_extensible for f in strict.fields] == [False, False, False]
    assert [f.node.is_extensible for f in form.fields] == [False, True, True]
    assert [f.node.struct_name for f in form.fields[:2]] == [f.node.c_name for f in strict.fields[:2]]
    assert form.fields[2].node.bounds == Bounds(2, 5, is_extensible=True)


def test_a_message_without_a_lost_marker_is_its_own_form():
    nodes = [node for nodes in lay_out(SCHEMA, [SCHEMA.messages["cam-1.4.1"]]).nodes.values() for node in nodes]
    assert not touched(nodes)


def test_a_name_that_is_taken_gets_an_underscore():
    schema = schema_of("A ::= SEQUENCE { d INTEGER (0..9, ...) (2..5), e A-ext } A-ext ::= NULL", "A")
    form = Message("A-ext", "a", 1, "test", schema.messages["A"].pdu, (), (), 0, 2, form_of="A")
    assert lay_out(schema, [schema.messages["A"], form]).pdus["A-ext"].c_name == "m_A_ext_"


def test_headers_and_stubs_know_only_the_types_of_the_message(tmp_path):
    layout = lay_out(SCHEMA, [SCHEMA.messages["cpm-2.1.1"], SCHEMA.messages["cpm-2.1.1-ext"]])
    write(layout, tmp_path)
    header = (tmp_path / "include" / "captain" / "r2_cpm211.h").read_text()
    assert "ConstraintWrappedCpmContainers" in header
    assert "_ext" not in header.replace("_extensible", "").replace("_extent", "")


@pytest.mark.parametrize("name", FORMS)
def test_both_forms_have_one_ros_2_type(name: str):
    both = [SCHEMA.messages[FORMS[name].form_of], FORMS[name]]
    for profile in profiles.PROFILES:
        [package] = profiles.packages(SCHEMA, both, profile)
        assert package.tops[name] == package.tops[FORMS[name].form_of]
        assert package.editions == (both[0],)


def test_page_of_a_message_names_its_ext_form(tmp_path):
    pages.write(SCHEMA, ["cpm-2.1.1", "cpm-2.1.1-ext"], tmp_path, lambda what: None)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["README.md", "cpm-2.1.1.md"]
    assert tells((tmp_path / "cpm-2.1.1.md").read_text(), "`cpm-2.1.1-ext`: ETSI TS 103 324 v2.1.1, ", "extension bit")


@pytest.mark.parametrize("name", FORMS)
def test_form_of_a_message_differs_in_name_standard_and_rank_alone(name: str):
    form, strict = captain_messages.find(name), captain_messages.find(FORMS[name].form_of)
    assert name == f"{strict.name}-ext"
    assert (form.form_of, strict.form_of) == (strict.name, "")
    assert form.rank > strict.rank
    assert tells(form.standard, f"{strict.standard}, ", "extension bit")
    for what in ("type", "release", "module", "pdu", "ids", "versions", "btp_port", "is_experimental"):
        assert getattr(form, what) == getattr(strict, what)


def test_more_elements_than_the_root_has_are_sent_in_the_ext_form_alone():
    # SIZE(1..8, ...) of cpmContainers
    strict, form = captain_messages.find("cpm-2.1.1"), captain_messages.find("cpm-2.1.1-ext")
    value = strict.decode(strict.from_json(LEAST))
    value["payload"]["cpmContainers"] *= 9
    octets = form.encode(value)
    assert form.decode(octets) == value
    assert form.from_json(form.to_json(octets)) == octets
    form.validate(octets)
    reference = Encoder(read_as(pruned(SCHEMA, FORMS["cpm-2.1.1-ext"].pdu), FORMS["cpm-2.1.1-ext"]))
    assert reference.encode(FORMS["cpm-2.1.1-ext"].pdu, value) == octets
    with pytest.raises(captain_messages.EncodeError, match=r"9 elements, not 1\.\.8"):
        strict.encode(value)


def test_a_view_of_one_form_is_not_encoded_by_the_other_but_its_dict_is():
    strict, form = captain_messages.find("cpm-2.1.1"), captain_messages.find("cpm-2.1.1-ext")
    octets = strict.from_json(LEAST)
    with pytest.raises(captain_messages.EncodeError, match="to_dict"):
        form.encode(strict.view(octets))
    assert strict.encode(form.decode(form.encode(strict.view(octets).to_dict()))) == octets


def kinds(node: Node, found: dict[Node, None]) -> dict[Node, None]:
    if node not in found:
        found[node] = None
        for child in node.children():
            kinds(child, found)
    return found


@pytest.mark.parametrize("name", FORMS)
def test_no_lost_marker_is_left_in_a_form(name: str):
    pdu = lay_out(SCHEMA, [FORMS[name]]).pdus[name]
    assert not [node for node in kinds(pdu, {}) if node.bounds.lost_marker and node.kind is not Kind.UTF8]


LEAST = """{"header": {"protocolVersion": 2, "messageId": 14, "stationId": 1}, "payload": {"managementContainer":
 {"referenceTime": 1, "referencePosition": {"latitude": 1, "longitude": 1, "positionConfidenceEllipse":
 {"semiMajorConfidence": 1, "semiMinorConfidence": 1, "semiMajorOrientation": 1}, "altitude":
 {"altitudeValue": 1, "altitudeConfidence": "unavailable"}}},
 "cpmContainers": [{"containerId": 2, "containerData": {}}]}}"""
