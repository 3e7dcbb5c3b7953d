"""The tables of both profiles, row by row as existing boxes and TS 103 248 have them."""

import pytest

from firmware.topics import ROWS, Topics, TypeRow
from tests.firmware.profile_table import NAMELESS_IN_LEGACY, TABLE

KNOWN = {row[0] for row in TABLE}


def pdu(number: int) -> bytes:
    return bytes((2, number))


@pytest.mark.parametrize(("number", "name", "port", "_"), TABLE)
def test_the_standard_profile_has_this_row(number: int, name: str, port: int, _: int | None) -> None:
    kind = Topics("standard").by_number[number]
    assert (kind.number, kind.name, kind.btp_port) == (number, name, port)


@pytest.mark.parametrize(("number", "name", "_", "port"), TABLE)
def test_the_legacy_profile_has_this_row(number: int, name: str, _: int, port: int | None) -> None:
    kind = Topics("legacy").by_number[number]
    assert (kind.number, kind.btp_port) == (number, port)
    assert kind.name == ("" if number in NAMELESS_IN_LEGACY else name)


def test_the_table_has_these_rows_and_no_other() -> None:
    assert {(row.number, row.name, row.standard, row.legacy) for row in ROWS} == set(TABLE)


@pytest.mark.parametrize("profile", ["standard", "legacy"])
@pytest.mark.parametrize("number", [number for number in range(256) if number not in KNOWN])
def test_every_other_id_is_nameless_and_has_no_port(profile: str, number: int) -> None:
    topics = Topics(profile)
    kind = topics.by_number[number]
    assert kind is topics.unknown
    assert (kind.name, kind.btp_port) == ("", None)


def test_names_are_those_of_the_profile_and_of_added_types_without_duplicates() -> None:
    standard, legacy = Topics("standard"), Topics("legacy")
    assert set(standard.names()) == {row.name for row in ROWS}
    assert set(standard.names()) - set(legacy.names()) == {"imzm", "mcm"}
    standard.add(TypeRow(200, "mine", 2100, 2100))
    assert (standard.names()[-1], standard.names().count("vam"), legacy.names().count("")) == ("mine", 1, 0)


@pytest.mark.parametrize("profile", ["standard", "legacy"])
def test_a_type_without_a_name_is_published_with_two_dots(profile: str) -> None:
    topics = Topics(profile)
    assert topics.envelopes[topics.unknown.row] == b"v2x.."


def test_ids_15_and_20_are_published_with_two_dots_in_the_legacy_profile() -> None:
    topics = Topics("legacy")
    assert {topics.envelopes[topics.by_number[number].row] for number in (15, 20)} == {b"v2x.."}
    assert not {b"v2x.imzm.", b"v2x.mcm."} & set(topics.by_envelope)


def test_two_dots_are_no_envelope_of_a_user() -> None:
    assert b"v2x.." not in Topics("standard").by_envelope
    assert b"v2x.." not in Topics("legacy").by_envelope


@pytest.mark.parametrize(("profile", "number"), [("standard", 16), ("legacy", 102)])
def test_the_vam_envelope_means_the_id_that_the_profile_sends(profile: str, number: int) -> None:
    assert Topics(profile).by_envelope[b"v2x.vam."].number == number


@pytest.mark.parametrize("profile", ["standard", "legacy"])
def test_every_envelope_leads_to_a_type_that_is_published_under_it(profile: str) -> None:
    topics = Topics(profile)
    for envelope, kind in topics.by_envelope.items():
        assert topics.envelopes[kind.row] == envelope


def test_reception_knows_the_ports_of_both_profiles_in_either() -> None:
    ports = {port for _, _, *both in TABLE for port in both if port}
    assert Topics("standard").ports == Topics("legacy").ports == ports


def test_a_row_of_the_users_adds_a_type_in_both_profiles() -> None:
    row = TypeRow(200, "mytest", 3000, 3000, priority=5, lifetime=0.5)
    for profile in ("standard", "legacy"):
        topics = Topics(profile, [row])
        kind = topics.by_envelope[b"v2x.mytest."]
        assert kind is topics.by_number[200]
        assert (kind.btp_port, kind.priority, kind.lifetime) == (3000, 5, 0.5)
        assert 3000 in topics.ports


def test_a_row_of_the_users_replaces_the_one_of_its_number() -> None:
    topics = Topics("standard", [TypeRow(2, "mycam", 2050, 2050)])
    assert topics.by_number[2].name == "mycam"
    assert b"v2x.cam." not in topics.by_envelope
    assert [kind.number for kind in topics.kinds].count(2) == 1


def test_a_row_of_the_users_gives_a_legacy_nameless_id_its_name() -> None:
    topics = Topics("legacy", [TypeRow(20, "mcm", 2017, 2017)])
    assert topics.by_envelope[b"v2x.mcm."].btp_port == 2017


def test_a_second_id_of_a_standard_name_leaves_the_envelope_to_the_standards_id() -> None:
    topics = Topics("standard", [TypeRow(200, "cam", 3000, 3000)])
    assert topics.by_envelope[b"v2x.cam."].number == 2
    assert topics.by_number[200].btp_port == 3000


@pytest.mark.parametrize("profile", ["standard", "legacy"])
def test_each_type_has_a_place_of_its_own_for_its_counters(profile: str) -> None:
    topics = Topics(profile, [TypeRow(200, "mytest", 3000, 3000)])
    assert [kind.row for kind in topics.kinds] == list(range(len(topics.kinds)))
    assert len(topics.envelopes) == len(topics.kinds)


def test_a_denm_is_more_urgent_than_a_cam_and_an_unknown_type_the_least() -> None:
    topics = Topics()
    denm, cam = topics.by_number[1], topics.by_number[2]
    assert denm.priority == 0 < cam.priority < topics.unknown.priority


@pytest.mark.parametrize("profile", ["standard", "legacy"])
def test_each_type_has_a_lane_and_two_ids_of_one_name_share_it(profile: str) -> None:
    urgent, *others = Topics(profile).lanes()
    assert urgent == {1}
    assert {16, 102} in others
    assert len(others) == len(ROWS) - 2
    assert frozenset().union(urgent, *others) == KNOWN
    assert sum(map(len, others)) + len(urgent) == len(KNOWN)


def test_lanes_are_in_the_order_of_priority() -> None:
    numbers = [min(lane) for lane in Topics().lanes()]
    worth = [Topics().by_number[number].priority for number in numbers]
    assert worth == sorted(worth)


def test_the_users_types_of_priority_0_are_urgent_too_and_others_have_a_lane_each() -> None:
    extra = [TypeRow(200, "alarm", 3000, 3000, priority=0), TypeRow(201, "mytest", 3001, 3001)]
    lanes = Topics("standard", extra).lanes()
    assert lanes[0] == {1, 200}
    assert {201} in lanes


def test_without_a_type_of_priority_0_nothing_is_urgent() -> None:
    lanes = Topics("standard", [TypeRow(1, "denm", 2002, 2002, priority=1)]).lanes()
    assert lanes[0] == frozenset()
    assert {1} in lanes


def test_two_hundred_types_of_the_users_share_the_last_lane_where_lanes_run_out() -> None:
    extra = [TypeRow(number, f"type{number}", 3000, 3000, priority=number % 7) for number in range(30, 230)]
    lanes = Topics("standard", extra).lanes()
    assert len(lanes) == 63
    assert {number for number in range(30, 230) if number % 7 == 0} < lanes[0]


def test_a_warning_has_the_traffic_class_of_a_warning() -> None:
    classes = {kind.name: kind.traffic_class for kind in Topics().kinds}
    assert (classes["denm"], classes["cam"], classes["poi"]) == (1, 2, 3)
