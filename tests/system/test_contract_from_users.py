"""Contract, section 1.2: valid and invalid messages of users at port 5555."""

import pytest

from tests.system.conftest import Bench, Launcher
from tests.system.user import air_hears_nothing_before_a_mark, mark

CAM = bytes.fromhex("020200000539") + b"from a user"
BAD_ENVELOPES = [
    b"",
    b"v",
    b"v2x",
    b"v2x.cam",
    b"v2x.CAM.",
    b"V2X.cam.",
    b"v2x.cam.foo.",
    b"v2x.cam..",
    b"v2x.. ",
    b" v2x.cam.",
    b"v2x.cam.\0",
    b"v2x.foo.",
    b"v2x..",
    b"v2x...",
    b"raw.",
    b"hb.counter",
    b"confirm.cam.",
    b"\xff\xfe\x80.",
    b"v2x.\xff.",
    b"v2x." + b"a" * 60_000 + b".",
]


def dropped(bench: Bench, reason: str, where: str = "from_users") -> int:
    return bench.station.drops().get((where, reason), 0)


def test_v2x_alone_is_classified_by_the_message_id(btp: Bench) -> None:
    btp.user.send(b"v2x.", b"\2\1\0\0\5\x39 denm")
    assert btp.air.hear() == (2002, b"\2\1\0\0\5\x39 denm")


@pytest.mark.parametrize("version", [0, 1, 2, 3, 255])
def test_the_protocol_version_does_not_matter_to_the_classification(btp: Bench, version: int) -> None:
    btp.user.send(b"v2x.", sent := bytes((version, 4)) + b"\0\0\5\x39 spatem")
    assert btp.air.hear() == (2004, sent)


def test_a_typed_envelope_is_believed_and_the_pdu_not_looked_at(btp: Bench) -> None:
    btp.user.send(b"v2x.denm.", CAM)
    assert btp.air.hear() == (2002, CAM)


@pytest.mark.parametrize("pdu_of", [b"\0", b"\2\2", b"\xff" * 5])
def test_a_typed_envelope_carries_pdus_of_one_octet_on(btp: Bench, pdu_of: bytes) -> None:
    btp.user.send(b"v2x.cam.", pdu_of)
    assert btp.air.hear() == (2001, pdu_of)


@pytest.mark.parametrize("envelope", BAD_ENVELOPES, ids=lambda envelope: repr(envelope[:16]))
def test_any_other_envelope_is_dropped_counted_and_explained(btp: Bench, envelope: bytes) -> None:
    before = dropped(btp, "bad-envelope")
    btp.user.send(envelope, CAM)
    air_hears_nothing_before_a_mark(btp.user, btp.air)
    rows = [row for row in btp.station.status()["drops"] if row["where"] == "from_users"]
    row = next(row for row in rows if row["reason"] == "bad-envelope")
    assert row["count"] == before + 1
    assert "v2x." in row["meaning"]


def test_a_drop_keeps_the_time_the_length_and_the_first_octets_of_the_last(btp: Bench) -> None:
    btp.user.send(b"v2x.", b"\2\2\0\0\5")
    air_hears_nothing_before_a_mark(btp.user, btp.air)
    row = next(row for row in btp.station.status()["drops"] if row["reason"] == "short-pdu")
    assert (row["octets"], row["sample"]) == (5, "0202000005")
    assert row["time"] > 1_700_000_000


@pytest.mark.parametrize("frame", [b"", b"v2x.", b"v2x.cam.", CAM, b"x" * 5000])
def test_one_frame_is_dropped_and_the_next_message_is_not_affected(btp: Bench, frame: bytes) -> None:
    before = dropped(btp, "one-frame")
    btp.user.send(frame)
    air_hears_nothing_before_a_mark(btp.user, btp.air)
    assert dropped(btp, "one-frame") == before + 1


@pytest.mark.parametrize("more", [[b""], [b"{}"], [b"x"], [b"{}", b"", b"v2x.denm."], [b"y"] * 62])
def test_of_three_frames_and_more_the_first_two_are_used(btp: Bench, more: list[bytes]) -> None:
    btp.user.send(b"v2x.cam.", CAM, *more)
    btp.user.send(b"v2x.denm.", CAM)
    assert [btp.air.hear(), btp.air.hear()] == [(2001, CAM), (2002, CAM)]


def test_one_two_and_three_frames_in_any_order_stay_apart(btp: Bench) -> None:
    sent = [mark() for _ in range(30)]
    for each in sent:
        btp.user.send(b"v2x.cam.")
        btp.user.send(b"v2x.cam.", each)
        btp.user.send(b"v2x.", each, b"v2x.denm.", each)
        btp.user.send(each)
    assert [btp.air.hear() for _ in range(60)] == [(2001, each) for each in sent for _ in range(2)]


@pytest.mark.parametrize("length", range(6))
def test_a_pdu_shorter_than_its_header_is_dropped_and_counted(btp: Bench, length: int) -> None:
    reason = "short-pdu" if length else "empty-pdu"
    before = dropped(btp, reason)
    btp.user.send(b"v2x.", CAM[:length])
    air_hears_nothing_before_a_mark(btp.user, btp.air)
    assert dropped(btp, reason) == before + 1


def test_an_empty_pdu_under_a_typed_envelope_is_dropped_and_counted(btp: Bench) -> None:
    before = dropped(btp, "empty-pdu")
    btp.user.send(b"v2x.cam.", b"")
    air_hears_nothing_before_a_mark(btp.user, btp.air)
    assert dropped(btp, "empty-pdu") == before + 1


@pytest.mark.parametrize("framing", ["pdu", "btp", "ethernet"])
def test_1500_octets_pass_both_ways_unchanged(framing: str, request: pytest.FixtureRequest) -> None:
    bench: Bench = request.getfixturevalue(framing)
    sent = CAM[:6] + bytes(range(256)) * 6
    sent = sent[:1500]
    bench.user.send(b"v2x.", sent)
    assert bench.air.hear().pdu == sent
    bench.air.send(sent)
    assert bench.user.receive().pdu == sent


@pytest.mark.parametrize("envelope", [b"v2x.", b"v2x.cam."])
@pytest.mark.parametrize("length", [1501, 1502, 65536])
def test_a_longer_pdu_is_refused_neither_sent_nor_shortened(btp: Bench, envelope: bytes, length: int) -> None:
    before = dropped(btp, "long-pdu")
    btp.user.send(envelope, CAM[:6] + bytes(length - 6))
    air_hears_nothing_before_a_mark(btp.user, btp.air)
    assert dropped(btp, "long-pdu") == before + 1


@pytest.mark.parametrize("framing", ["pdu", "btp", "ethernet"])
@pytest.mark.parametrize("length", [1501, 2000, 60_000])
def test_a_longer_pdu_from_an_interface_is_dropped_with_neither_message_sent(
    framing: str, length: int, request: pytest.FixtureRequest
) -> None:
    bench: Bench = request.getfixturevalue(framing)
    before = sum(count for (where, _), count in bench.station.drops().items() if where == "g5")
    bench.air.send(CAM[:6] + bytes(length - 6))
    bench.user.hears_nothing_before_a_mark(bench.air)
    drops = bench.station.drops()
    assert sum(count for (where, _), count in drops.items() if where == "g5") == before + 1
    assert drops["g5", "long-pdu"] >= 1


@pytest.mark.parametrize("number", [0, 17, 19, 99, 200, 255])
def test_an_unknown_message_id_under_v2x_is_dropped_with_its_reason(btp: Bench, number: int) -> None:
    before = dropped(btp, "unknown-type")
    btp.user.send(b"v2x.", bytes((2, number)) + CAM[2:])
    air_hears_nothing_before_a_mark(btp.user, btp.air)
    assert dropped(btp, "unknown-type") == before + 1


def test_strict_checking_drops_an_envelope_that_contradicts_the_header(launch: Launcher) -> None:
    bench = launch("btp", endpoint={"strict": True})
    bench.user.send(b"v2x.denm.", CAM)
    bench.user.send(b"v2x.cam.", b"\2\2")
    air_hears_nothing_before_a_mark(bench.user, bench.air)
    drops = bench.station.drops()
    assert drops["from_users", "header-mismatch"] == 1
    assert drops["from_users", "short-pdu"] == 1


def test_strict_checking_passes_what_agrees(launch: Launcher) -> None:
    bench = launch("btp", endpoint={"strict": True})
    bench.user.send(b"v2x.cam.", CAM)
    bench.user.send(b"v2x.denm.", b"\2\1" + CAM[2:])
    bench.user.send(b"v2x.vam.", b"\3\x10" + CAM[2:])
    bench.user.send(b"v2x.vam.", b"\3\x66" + CAM[2:])
    assert [bench.air.hear().port for _ in range(4)] == [2001, 2002, 2018, 2018]


def test_the_pull_socket_offers_the_same_and_loses_nothing_to_a_slow_joiner(
    btp: Bench, launch_shared: Launcher
) -> None:
    stranger = launch_shared.user(btp.station)
    stranger.push_pdu(b"v2x.", CAM)
    assert btp.air.hear() == (2001, CAM)


def test_the_pull_socket_drops_for_the_same_reasons(pdu: Bench) -> None:
    before = pdu.station.drops()
    pdu.user.push.send_multipart([b"v2x.cam"])
    pdu.user.push_pdu(b"v2x.cam", CAM)
    pdu.user.push_pdu(b"v2x.", CAM[:5])
    pdu.user.push_pdu(b"v2x.", b"\2\xff" + CAM)
    pdu.user.push_pdu(b"v2x.cam.", b"")
    pdu.user.push_pdu(b"v2x.cam.", bytes(1501))
    pdu.user.push_pdu(b"v2x.cam.", sent := mark())
    assert pdu.air.hear().pdu == sent
    after = pdu.station.drops()
    reasons = ["one-frame", "bad-envelope", "short-pdu", "unknown-type", "empty-pdu", "long-pdu"]
    assert {key: after[key] - before.get(key, 0) for key in [("pull", each) for each in reasons]} == {
        ("pull", each): 1 for each in reasons
    }
