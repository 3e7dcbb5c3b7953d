"""The likeliest cause, each with octets that were made wrong in just that way."""

from firmware.codec.causes import Case, likeliest
from firmware.codec.identify import Identifier, Unknown
from tests.firmware.codec.standin import BARE, DOOR, NEW, OLD, SAME, Message, octets

ALL = [OLD, NEW, SAME, DOOR, BARE]


def cause(pdu: bytes, port: int | None = None, known: list[Message] = ALL, asked: list[Message] | None = None) -> str:
    found = Identifier(asked or known, is_asked=asked is not None).identify(pdu, port)
    assert isinstance(found, Unknown)
    return likeliest(Case(pdu, known, found.nearest, port))


def test_fewer_octets_than_the_header_are_truncated():
    assert cause(b"\x02\x42\0") == "it is truncated: 3 octets, and the ITS PDU header alone has 6"


def test_a_header_with_nothing_behind_it_is_truncated():
    assert cause(octets(DOOR)) == "it is truncated: its 6 octets are an ITS PDU header, and nothing follows"


def test_six_octets_that_no_message_begins_with_are_no_truncated_header():
    assert cause(bytes.fromhex("02ff00000001")).startswith("`captain decode --list` lists all editions")


def test_a_message_that_was_cut_off_is_truncated_where_it_ends():
    assert cause(octets(DOOR, 1, 2)) == "it is truncated: its 8 octets end inside body.depth"


def test_octets_that_follow_the_message_are_counted():
    assert cause(octets(DOOR, 1, 2, 3) + bytes(5)).startswith("5 octets follow the 9 of the message")


def test_an_edition_that_was_asked_for_in_vain_is_told_with_the_one_that_fits():
    told = cause(octets(NEW, 5, 1), asked=[OLD])
    assert told == "it is of another edition: it decodes as ball-2.1"


def test_the_wrong_port_is_told_with_both_types():
    told = cause(octets(DOOR, 99, 2, 3), port=3001)
    assert told == "it came by the wrong port: BTP port 3001 is that of ball, messageID 67 that of door"


def test_a_message_by_the_wrong_port_that_was_cut_off_as_well_is_told_both():
    told = cause(octets(DOOR, 1), port=3001, known=[NEW, DOOR])
    assert told.startswith("it came by the wrong port: ")
    assert told.endswith("; or it is truncated: its 7 octets end inside body.height")


def test_the_port_of_the_legacy_profile_is_not_wrong():
    cpm = Message("cpm-1", ids=(14,), versions=(2,), fields={"a": 9}, btp_port=2009)
    cam = Message("cam-1", ids=(2,), versions=(2,), fields={"a": 9}, btp_port=2001)
    assert "port" not in cause(octets(cpm, 99), port=2001, known=[cpm, cam])


def test_a_version_that_no_edition_has_is_another_release():
    told = cause(octets(DOOR, 99, 2, 3, version=7))
    assert told == "it is of another release: protocolVersion is 7, and the library has this message with 2"


def test_the_legacy_number_of_vam_is_told():
    vam = Message("vam-2", ids=(16,), versions=(2,), fields={"a": 9})
    assert "messageID 102 is the number that older boxes used for VAM" in cause(
        octets(vam, 99, number=102), known=[vam]
    )


def test_a_message_that_the_library_does_not_have_is_told_by_name():
    told = cause(octets(DOOR, 200, 200, 200, number=12))
    assert told.startswith("it is saem, which the library does not have: `captain decode --list`")


def test_a_btp_header_in_front_is_seen():
    told = cause((2001).to_bytes(2) + bytes(2) + octets(DOOR, 1, 2, 3))
    assert told == "it begins with a BTP header of port 2001: leave out the first 4 octets"


def test_a_geonetworking_packet_without_its_end_is_seen():
    assert cause(bytes.fromhex("11001a0120500080") + bytes(40)).startswith("it begins like a GeoNetworking packet")


def test_what_shows_no_cause_is_damaged_or_of_an_unknown_edition():
    assert cause(octets(DOOR, 99, 2, 3)).startswith("it was damaged on its way, or follows an edition")
