"""Messages of ROS 2 as data."""

import json
import zlib

from asn1.backends.ros2 import plan, profile_etsi_its
from asn1.model.text import load_schema
from asn1.model.types import Message
from tests.asn1.imported import snippet

SCHEMA = load_schema()


def read(*editions):
    packages = profile_etsi_its.packages(SCHEMA, [SCHEMA.messages[one] for one in editions])
    return json.loads(zlib.decompress(plan.octets(SCHEMA, packages)))


def fields(document, name):
    return next(rows for type_, rows in document["types"] if type_ == name)


def test_a_field_has_its_type_its_role_and_the_way_to_it():
    document = read("cam-1.4.1")
    number, name, role, source, numbers, constants = fields(document, "CamParameters")[2]
    assert document["types"][number][0] == "LowFrequencyContainer"
    assert (name, role, source, numbers, constants) == (
        "low_frequency_container", "v", ["lowFrequencyContainer"], None, "",
    )  # fmt: skip
    assert fields(document, "CamParameters")[3][:4] == [
        "bool", "low_frequency_container_is_present", "p", ["lowFrequencyContainer"],
    ]  # fmt: skip


def test_a_choice_and_an_enumeration_have_their_numbers():
    document = read("cam-1.4.1")
    assert fields(document, "HighFrequencyContainer")[0][2:5] == [
        "c", [], {"basicVehicleContainerHighFrequency": 0, "rsuContainerHighFrequency": 1},
    ]  # fmt: skip
    assert fields(document, "DriveDirection")[0][4] == {"forward": 0, "backward": 1, "unavailable": 2}


def test_a_default_and_the_row_of_an_open_type_are_part_of_the_way():
    assert [["validityDuration", 600]] in [row[3] for row in fields(read("denm-1.3.1"), "ManagementContainer")]
    steps = [row[3] for row in fields(read("cpm-2.1.1"), "WrappedCpmContainer")]
    assert [["containerData", 1, "containerId"]] in steps


def test_messages_that_packages_have_alike_are_there_once():
    alone = len(read("cam-2.3.1")["types"]) + len(read("vam-2.3.1")["types"])
    assert len(read("cam-2.3.1", "vam-2.3.1")["types"]) < alone - 30


def test_the_same_schema_gives_the_same_source_and_what_ros_cannot_say_is_not_in_it():
    schema, root = snippet("Top ::= SEQUENCE { more Top OPTIONAL }", "Top")
    edition = Message("top-1", "top", 1, "", root, (), (), 0, 1)
    source = plan.source(schema, [edition])
    assert source == plan.source(schema, [edition])
    octets = bytes(int(word) for word in source.partition("{\n")[2].partition("}")[0].replace(",", " ").split())
    assert json.loads(zlib.decompress(octets)) == {"types": [], "tops": {}}
