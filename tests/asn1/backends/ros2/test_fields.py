"""Fields of a message: their place in a value, and missing ones."""

import pytest

from asn1.backends.ros2 import profile_etsi_its, profile_v2x_msgs, profiles
from asn1.backends.ros2.model import Role, RosError
from asn1.model.text import load_schema
from asn1.model.types import Message
from tests.asn1.imported import imported, snippet

SCHEMA = load_schema()


def etsi_its(edition):
    return profile_etsi_its.package(SCHEMA, SCHEMA.messages[edition])


def v2x(*editions):
    return profile_v2x_msgs.packages(SCHEMA, [SCHEMA.messages[one] for one in editions])[0]


def made(text, name="Top"):
    schema, root = snippet(text, name)
    return profile_etsi_its.package(schema, Message("top-1", "top", 1, "", root, (), (), 0, 1)).messages


def lines(message):
    return [(field.text, field.role, ".".join(field.source)) for field in message.fields]


def test_an_optional_component_has_a_flag_behind_it():
    assert lines(etsi_its("cam-1.4.1").messages["CamParameters"])[2:4] == [
        ("LowFrequencyContainer low_frequency_container", Role.VALUE, "lowFrequencyContainer"),
        ("bool low_frequency_container_is_present", Role.PRESENT, "lowFrequencyContainer"),
    ]


def test_a_choice_is_a_number_and_every_alternative():
    choice, first, second = etsi_its("cam-1.4.1").messages["HighFrequencyContainer"].fields
    assert choice.options == ((0, "basicVehicleContainerHighFrequency"), (1, "rsuContainerHighFrequency"))
    assert [one.value for field in (first, second) for one in field.constants] == [0, 1]


def test_a_bit_string_is_octets_and_the_bits_that_do_not_count():
    assert lines(etsi_its("cam-1.4.1").messages["AccelerationControl"]) == [
        ("uint8[] value", Role.VALUE, ""),
        ("uint8 bits_unused", Role.BITS_UNUSED, ""),
    ]


def test_what_a_type_without_a_name_holds_stands_in_its_place():
    assert lines(made("Top ::= SEQUENCE { a SEQUENCE { b BOOLEAN, c INTEGER (0..9) OPTIONAL } }")["Top"]) == [
        ("bool b", Role.VALUE, "a.b"),
        ("uint8 c", Role.VALUE, "a.c"),
        ("bool c_is_present", Role.PRESENT, "a.c"),
    ]


def test_alternatives_of_a_choice_without_a_name_have_its_name_in_front():
    names = [field.name for field in etsi_its("mapem-2.1.1").messages["ComputedLane"].fields]
    assert names[1:7] == [
        "offset_xaxis_choice", "offset_xaxis_small", "offset_xaxis_large",
        "offset_yaxis_choice", "offset_yaxis_small", "offset_yaxis_large",
    ]  # fmt: skip


def test_two_fields_that_would_be_called_alike_are_told_apart():
    text = "Top ::= SEQUENCE { a SEQUENCE { x BOOLEAN }, b SEQUENCE { x BOOLEAN } }"
    assert [field.name for field in made(text)["Top"].fields] == ["x", "b_x"]


def test_regional_extensions_are_left_out_and_said():
    message = etsi_its("mapem-2.1.1").messages["SignalControlZone"]
    assert not message.fields
    assert message.left_out == (("zone",),)


def test_an_open_type_has_a_field_for_each_container_with_the_number_that_selects_it():
    fields = etsi_its("cpm-2.1.1").messages["WrappedCpmContainer"].fields
    assert lines(etsi_its("cpm-2.1.1").messages["WrappedCpmContainer"])[0][0] == "CpmContainerId container_id"
    assert [(one.source, one.constants[0].value) for one in fields[1:3]] == [
        (("containerData", "1"), 1),
        (("containerData", "2"), 2),
    ]


def test_a_component_that_would_hold_its_message_stands_by_its_own_components():
    message = etsi_its("ivim-2.1.1").messages["DestinationPlace"]
    assert lines(message)[1] == (
        "uint8[] dest_rs_code_country_code", Role.VALUE, "destRSCode.pictogramCode.countryCode",
    )  # fmt: skip
    assert message.unflagged == (("destRSCode",),)
    [number] = [
        one for field in message.fields for one in field.constants if one.name.endswith("_TRAFFIC_SIGN_PICTOGRAM")
    ]
    assert number.name == "DEST_RS_CODE_CHOICE_SERVICE_CATEGORY_CODE_TRAFFIC_SIGN_PICTOGRAM"


def test_a_message_that_holds_itself_is_told():
    with pytest.raises(RosError, match="Top contains itself"):
        made("Top ::= SEQUENCE { more Top OPTIONAL }")


def test_two_messages_of_which_rosidl_would_make_the_same_files_are_told():
    text = "Top ::= SEQUENCE { a StationID, b StationId } StationID ::= INTEGER (0..9) StationId ::= INTEGER (0..9)"
    with pytest.raises(RosError, match=r"the messages StationI[Dd] and StationI[Dd] would have the same file name"):
        made(text)


@pytest.mark.parametrize("profile", profiles.PROFILES)
def test_station_id_and_stationid_of_one_dictionary_are_told_apart(profile):
    [package] = profiles.packages(SCHEMA, [SCHEMA.messages["evcsn-1.1.1"]], profile)
    assert {"StationId", "StationIDCDD221"} <= set(package.messages)


def test_a_default_stands_in_a_constant_and_has_no_flag():
    fields = etsi_its("denm-1.3.1").messages["ManagementContainer"].fields
    [field] = [one for one in fields if one.name.startswith("validity_duration")]
    assert [(one.name, one.value) for one in field.constants] == [("VALIDITY_DURATION_DEFAULT", 600)]


def test_every_subcause_belongs_to_a_denm_though_no_component_is_one():
    assert "AdverseWeatherConditionAdhesionSubCauseCode" in etsi_its("denm-1.3.1").messages


@pytest.mark.parametrize("profile", profiles.PROFILES)
def test_every_edition_has_a_message_of_its_own(profile):
    packages = profiles.packages(SCHEMA, list(SCHEMA.messages.values()), profile)
    assert {name for package in packages for name in package.tops} == set(SCHEMA.messages)
    assert len({package.name for package in packages}) == len(packages)


def test_v2x_msgs_has_numbers_of_one_type_and_flags_before_the_field():
    assert lines(v2x("cam-1.4.1").messages["SafetyCarContainer"])[1:3] == [
        ("bool incident_indication_present", Role.PRESENT, "incidentIndication"),
        ("CauseCode incident_indication", Role.VALUE, "incidentIndication"),
    ]
    assert lines(v2x("cam-1.4.1").messages["GenerationDeltaTime"]) == [("int64 generation_delta_time", Role.VALUE, "")]


def test_v2x_msgs_chooses_from_1_and_nothing_with_0():
    select = v2x("cam-1.4.1").messages["LowFrequencyContainer"].fields[0]
    assert select.text == "int64 low_frequency_container_container_select"
    assert select.nothing == 0
    assert select.options == ((1, "basicVehicleContainerLowFrequency"),)


@pytest.mark.parametrize(
    ("edition", "message", "field"),
    [
        ("cam-1.4.1", "PathHistory", "PathPoint[] history"),
        ("cam-1.4.1", "ProtectedCommunicationZonesRSU", "ProtectedCommunicationZone[] zonesrsu"),
        ("denm-1.3.1", "RestrictedTypes", "StationType[] types"),
        ("denm-1.3.1", "Traces", "PathHistory[] traces"),
        ("mapem-2.1.1", "NodeSetXY", "NodeXY[] xy"),
        ("mapem-2.1.1", "NodeAttributeXYList", "NodeAttributeXY[] xylist"),
        ("spatem-2.1.1", "EnabledLaneList", "LaneID[] list"),
        ("ivim-2.1.1", "AbsolutePositionsWAltitude", "AbsolutePositionWAltitude[] waltitude"),
        ("ivim-2.1.1", "ConstraintTextLines1", "Text[] lines1"),
        ("ivim-2.1.1", "ISO14823Attributes", "ISO14823Attribute[] o14823attributes"),
    ],
)
def test_v2x_msgs_calls_a_list_by_the_last_word_of_its_type(edition, message, field):
    # The .msg files of v2x_msgs
    assert [one.text for one in v2x(edition).messages[message].fields] == [field]


def test_v2x_msgs_has_lists_with_a_header():
    assert [field.text for field in v2x("ssem-2.1.1").messages["SSEMList"].fields] == [
        "std_msgs/Header header", "SSEM[] ssems",
    ]  # fmt: skip


def test_names_in_v2x_msgs_do_not_depend_on_which_messages_are_asked_for():
    alone, together = v2x("spatem-2.1.1"), v2x("spatem-2.1.1", "cam-1.4.1")
    assert alone.messages.items() <= together.messages.items()
    assert "SpeedConfidenceDSRC" in alone.messages


def test_two_types_of_one_name_are_told_where_the_profile_has_no_other_name():
    a = "A DEFINITIONS AUTOMATIC TAGS ::= BEGIN IMPORTS X FROM B;\nTop ::= SEQUENCE { x X, y Y }\nY ::= SEQUENCE { z Z }\nZ ::= BOOLEAN\nEND"
    b = "B DEFINITIONS AUTOMATIC TAGS ::= BEGIN\nX ::= SEQUENCE { z Z }\nZ ::= INTEGER (0..3)\nEND"
    from asn1.model.types import Reference

    root = Reference("r1_a", "Top")
    schema = imported({"r1_a": a, "r1_b": b}, root)
    with pytest.raises(RosError, match="Z: two different types have this name"):
        profile_etsi_its.package(schema, Message("top-1", "top", 1, "", root, (), (), 0, 1))
