"""Decoded messages as CDR and .msg text, by the plan of the real message library."""

import hashlib

import captain_messages
import pytest

from firmware.lab.laboratory import vectors
from firmware.recorder import ros2

TYPES = ros2.Types(captain_messages.ros2_plan())

# Octets of a PDU, its edition, octets and SHA-256 of what compiled code writes of it (to_cdr), which `make ros2` compares
# with rosbags and with rclpy.
CDR = [
    (404, "denm-1.3.1", 904, "1f83201f0887e46c"),
    (160, "cam-1.4.1", 417, "ff5cc0419185fe82"),
    (536, "mapem-2.1.1", 8245, "74d1333ffdc0cae3"),
    (203, "spatem-2.1.1", 825, "d4eeba933bcc8913"),
    (73, "ivim-2.1.1", 629, "1cbb46b924ae8d1c"),
    (624, "cpm-tr-2.1.1", 3094, "9e93dcc02f225c59"),
    (46, "cam-1.4.1", 209, "9b4ec46d93cb6bde"),
    (143, "cam-1.4.1", 385, "b7486626d7627654"),
    (8, "mapem-2.1.1", 77, "b77423888a67ee51"),
    (34, "vam-2.3.1", 343, "b6625e478e7fb54c"),
    (43, "denm-1.3.1", 264, "4eda4302859a152d"),
    (41, "cam-1.4.1", 209, "48e7dcd14d7ff971"),
]
PDUS = {len(vector.pdu): vector.pdu for vector in vectors()}


@pytest.mark.parametrize(("octets", "edition", "count", "digest"), CDR)
def test_a_message_of_the_lab_is_written_as_compiled_code_writes_it(octets, edition, count, digest):
    cdr = TYPES.writer(edition)(captain_messages.find(edition).decode(PDUS[octets]))
    assert (len(cdr), hashlib.sha256(cdr).hexdigest()[:16]) == (count, digest)


def test_an_item_that_no_edition_knows_is_the_highest_number():
    value = captain_messages.find("cam-1.4.1").decode(PDUS[41])
    high = value["cam"]["camParameters"]["highFrequencyContainer"][1]
    known = TYPES.writer("cam-1.4.1")(value)
    high["driveDirection"] = 7
    unknown = TYPES.writer("cam-1.4.1")(value)
    assert [(a, b) for a, b in zip(known, unknown, strict=True) if a != b] == [(2, 255)]


def test_the_definition_holds_that_of_every_message_inside():
    text = TYPES.definition("cam-1.4.1")
    own, *others = text.split("=" * 80 + "\nMSG: ")
    assert own == "ItsPduHeader header\nCoopAwareness cam\n"
    assert others[0].startswith("etsi_its_cam_msgs/ItsPduHeader\nuint8 protocol_version\n")
    names = [other.partition("\n")[0] for other in others]
    assert "etsi_its_cam_msgs/LongitudinalAccelerationValue" in names
    assert len(set(names)) == len(names)


def test_constants_are_in_the_definition():
    assert "\nuint16 UNAVAILABLE=16383\n" in TYPES.definition("cam-1.4.1")


def test_types_are_called_as_in_etsi_its_messages_and_have_their_hash():
    assert TYPES.name("cpm-2.1.1") == "etsi_its_cpm_ts_msgs/msg/CollectivePerceptionMessage"
    assert TYPES.name("cam-2.3.1") == "captain_cam_2_3_1_msgs/msg/CAM"
    assert TYPES.hash("cam-1.4.1").startswith("RIHS01_")


def test_every_message_of_the_library_has_a_type():
    assert all(message.name in TYPES for message in captain_messages.all())
