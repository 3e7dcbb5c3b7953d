"""Contract, section 2: message ids, names in envelopes, BTP ports on the wire, in both profiles."""

from typing import Any

import pytest

from tests.firmware.profile_table import NAMELESS_IN_LEGACY, TABLE
from tests.system.conftest import Bench, Launcher
from tests.system.user import air_hears_nothing_before_a_mark

NAMED = [row for row in TABLE if row[0] not in NAMELESS_IN_LEGACY]
SENT_IN_LEGACY = [(number, name, port) for number, name, _, port in NAMED if port]


def pdu_of(number: int) -> bytes:
    return bytes((2, number)) + bytes.fromhex("00000539") + b"body"


@pytest.mark.parametrize(("number", "name", "port", "_"), TABLE)
def test_standard_ports_by_message_id_and_by_envelope(btp: Bench, number: int, name: str, port: int, _: int) -> None:
    btp.user.send(b"v2x.", pdu_of(number))
    btp.user.send(b"v2x.%s." % name.encode(), pdu_of(number))
    assert [btp.air.hear(), btp.air.hear()] == [(port, pdu_of(number))] * 2


@pytest.mark.parametrize(("number", "name", "port"), SENT_IN_LEGACY)
def test_legacy_ports_by_message_id_and_by_envelope(legacy: Bench, number: int, name: str, port: int) -> None:
    legacy.user.send(b"v2x.", pdu_of(number))
    legacy.user.send(b"v2x.%s." % name.encode(), pdu_of(number))
    assert [legacy.air.hear(), legacy.air.hear()] == [(port, pdu_of(number))] * 2


@pytest.mark.parametrize("number", [8, 15, 20])
def test_what_the_legacy_profile_does_not_send_is_dropped_with_its_reason(legacy: Bench, number: int) -> None:
    before = sum(legacy.station.drops().values())
    legacy.user.send(b"v2x.", pdu_of(number))
    air_hears_nothing_before_a_mark(legacy.user, legacy.air)
    drops = legacy.station.drops()
    assert sum(drops.values()) == before + 1
    assert {reason for where, reason in drops if where == "from_users"} <= {"no-port", "unknown-type", "bad-envelope"}


@pytest.mark.parametrize("name", ["tistpgtransaction", "imzm", "mcm"])
def test_the_legacy_profile_sends_nothing_under_their_envelopes_either(legacy: Bench, name: str) -> None:
    legacy.user.send(b"v2x.%s." % name.encode(), pdu_of(8))
    air_hears_nothing_before_a_mark(legacy.user, legacy.air)


@pytest.mark.parametrize(("number", "name", "standard", "old"), TABLE)
def test_reception_accepts_the_ports_of_both_profiles_in_profile_standard(
    btp: Bench, number: int, name: str, standard: int, old: int | None
) -> None:
    for port in {standard, old or standard}:
        btp.air.send(pdu_of(number), port)
        received = btp.user.receive()
        assert (received.envelope, received.pdu) == (b"v2x.%s." % name.encode(), pdu_of(number))


@pytest.mark.parametrize(("number", "name", "standard", "old"), NAMED)
def test_reception_accepts_the_ports_of_both_profiles_in_profile_legacy(
    legacy: Bench, number: int, name: str, standard: int, old: int | None
) -> None:
    for port in {standard, old or standard}:
        legacy.air.send(pdu_of(number), port)
        received = legacy.user.receive()
        assert (received.envelope, received.pdu) == (b"v2x.%s." % name.encode(), pdu_of(number))


@pytest.mark.parametrize("number", [15, 20])
def test_ids_without_a_name_in_the_original_stay_nameless_in_profile_legacy(legacy: Bench, number: int) -> None:
    legacy.air.send(pdu_of(number), 2017)
    assert legacy.user.receive().envelope == b"v2x.."


def test_the_destination_port_info_of_what_leaves_is_zero(btp: Bench) -> None:
    btp.user.send(b"v2x.cam.", pdu_of(2))
    assert btp.air.socket.recv(2048) == b"\x07\xd1\0\0" + pdu_of(2)


@pytest.mark.parametrize("port", [0, 1, 42, 1999, 2100, 65535])
def test_a_port_that_no_table_knows_is_dropped_with_its_reason(btp: Bench, port: int) -> None:
    before = btp.station.drops().get(("g5", "btp-port"), 0)
    btp.air.send(pdu_of(2), port)
    btp.user.hears_nothing_before_a_mark(btp.air)
    assert btp.station.drops()["g5", "btp-port"] == before + 1


def test_a_port_that_no_table_knows_is_delivered_where_that_is_wanted(launch: Launcher) -> None:
    bench = launch("btp", reception={"unknown_btp_port": "deliver"})
    bench.air.send(pdu_of(2), 42)
    assert bench.user.receive().envelope == b"v2x.cam."
    for size in range(1, 6):
        bench.air.send(pdu_of(2)[:size], 42)
        received = bench.user.receive()
        assert (received.envelope, received.pdu) == (b"v2x..", pdu_of(2)[:size])


EXPERIMENTAL = """
[[types]]
number = 200
name = "mytest"
btp_port = 3000
"""


def test_a_row_of_the_configuration_adds_a_type_both_ways(launch: Launcher) -> None:
    bench = launch("btp", more=EXPERIMENTAL)
    bench.user.send(b"v2x.", pdu_of(200))
    bench.user.send(b"v2x.mytest.", pdu_of(200))
    assert [bench.air.hear(), bench.air.hear()] == [(3000, pdu_of(200))] * 2
    bench.air.send(pdu_of(200), 3000)
    received = bench.user.receive()
    assert (received.envelope, received.pdu) == (b"v2x.mytest.", pdu_of(200))


def test_a_row_of_the_configuration_replaces_a_type(launch: Launcher) -> None:
    bench = launch("btp", more='[[types]]\nnumber = 2\nname = "cam"\nbtp_port = 2050\n')
    bench.user.send(b"v2x.", pdu_of(2))
    assert bench.air.hear() == (2050, pdu_of(2))


def test_a_row_without_a_port_is_named_on_reception_and_not_sent(launch: Launcher) -> None:
    bench = launch("pdu", more='[[types]]\nnumber = 201\nname = "onlyin"\n')
    bench.user.send(b"v2x.onlyin.", pdu_of(201))
    air_hears_nothing_before_a_mark(bench.user, bench.air)
    assert bench.station.drops()["from_users", "no-port"] == 1
    bench.air.send(pdu_of(201))
    assert bench.user.receive().envelope == b"v2x.onlyin."


@pytest.mark.parametrize("framing", ["pdu", "btp", "ethernet"])
@pytest.mark.parametrize("place", range(12))
def test_real_messages_travel_both_ways_unchanged(
    framing: str, place: int, vectors: list[dict[str, Any]], request: pytest.FixtureRequest
) -> None:
    bench: Bench = request.getfixturevalue(framing)
    name, sent = vectors[place]["type"], vectors[place]["pdu"]
    bench.user.send(b"v2x.", sent)
    bench.user.send(b"v2x.%s." % name.encode(), sent)
    ports = [None] if framing == "pdu" else [port for _, known, port, _ in NAMED if known == name]
    assert [bench.air.hear(), bench.air.hear()] == [(ports[0], sent)] * 2
    bench.air.send(sent, ports[0] or 0)
    received = bench.user.receive()
    assert (received.envelope, received.pdu) == (b"v2x.%s." % name.encode(), sent)
