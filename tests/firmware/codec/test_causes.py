"""The likeliest cause, each with octets that were made wrong in just that way."""

from firmware.codec.causes import Case, likeliest
from firmware.codec.identify import Identifier, Unknown
from tests.firmware.codec.standin import BARE, DOOR, NEW, OLD, SAME, Message, octets
from tests.said import tells

ALL = [OLD, NEW, SAME, DOOR, BARE]


def cause(pdu: bytes, port: int | None = None, known: list[Message] = ALL, asked: list[Message] | None = None) -> str:
    found = Identifier(asked or known, is_asked=asked is not None).identify(pdu, port)
    assert isinstance(found, Unknown)
    return likeliest(Case(pdu, known, found.nearest, port))


def test_message_shorter_than_its_header_is_truncated():
    assert tells(cause(b"\x02\x42\0"), "truncated", "3 octets", "header", "6")


def test_a_header_with_nothing_behind_it_is_truncated():
    assert cause(octets(DOOR)) == "it is truncated: its 6 octets are an ITS PDU header, and nothing follows"


def test_six_octets_that_no_message_begins_with_are_no_truncated_header():
    assert cause(bytes.fromhex("02ff00000001")).startswith("`captain decode --list` lists all editions")


def test_message_that_was_cut_off_is_truncated_where_it_ends():
    assert tells(cause(octets(DOOR, 1, 2)), "truncated", "8 octets", "body.depth")


def test_octets_that_follow_the_message_are_counted():
    assert cause(octets(DOOR, 1, 2, 3) + bytes(5)).startswith("5 octets follow the 9 of the message")


def test_message_of_another_edition_than_asked_for_gives_the_one_that_fits():
    told = cause(octets(NEW, 5, 1), asked=[OLD])
    assert tells(told, "another edition", "ball-2.1")


def test_message_by_the_wrong_port_gives_both_types():
    told = cause(octets(DOOR, 99, 2, 3), port=3001)
    assert tells(told, "wrong port", "port 3001 ", "ball", "messageID 67 ", "door")
    assert "truncated" not in told


def test_message_by_the_wrong_port_that_was_cut_off_gives_both_causes():
    told = cause(octets(DOOR, 1), port=3001, known=[NEW, DOOR])
    assert tells(told, "wrong port", "; or ", "truncated", "7 octets", "body.height")


def test_the_port_of_the_legacy_profile_is_not_wrong():
    cpm = Message("cpm-1", ids=(14,), versions=(2,), fields={"a": 9}, btp_port=2009)
    cam = Message("cam-1", ids=(2,), versions=(2,), fields={"a": 9}, btp_port=2001)
    assert "port" not in cause(octets(cpm, 99), port=2001, known=[cpm, cam])


def test_message_of_an_unknown_version_is_of_another_release():
    told = cause(octets(DOOR, 99, 2, 3, version=7))
    assert tells(told, "another release", "protocolVersion is 7", "with 2")


def test_vam_of_the_legacy_number_is_of_older_boxes():
    vam = Message("vam-2", ids=(16,), versions=(2,), fields={"a": 9})
    assert tells(cause(octets(vam, 99, number=102), known=[vam]), "messageID 102 ", "older", "VAM")


def test_message_that_the_library_does_not_have_is_named():
    told = cause(octets(DOOR, 200, 200, 200, number=12))
    assert tells(told, "saem", "library", "not have", "`captain decode --list`")


def test_message_behind_a_btp_header_gives_its_port():
    told = cause((2001).to_bytes(2) + bytes(2) + octets(DOOR, 1, 2, 3))
    assert tells(told, "BTP header", "port 2001", "first 4 octets")


def test_a_geonetworking_packet_without_its_end_is_seen():
    assert cause(bytes.fromhex("11001a0120500080") + bytes(40)).startswith("it begins like a GeoNetworking packet")


def test_message_without_another_cause_is_damaged_or_of_an_unknown_edition():
    assert tells(cause(octets(DOOR, 99, 2, 3)), "damaged", "edition")
