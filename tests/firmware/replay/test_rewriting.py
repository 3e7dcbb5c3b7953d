"""Messages of another station, of now, of elsewhere: exactly those fields change."""

import json
import math

import captain_messages
import pytest
from hypothesis import given
from hypothesis import strategies as st

from board.runtime.errors import RequestError
from board.time.scales import its_time_ms, leap_seconds
from drivers.message import Area, Ego, Position, Request, Shape
from drivers.wire import frame as ethernet
from drivers.wire.geonet import packet as geonet_packet
from drivers.wire.geonet.sender import Sender
from firmware.codec.reading import Pdu
from firmware.lab.laboratory import Vector, vectors
from firmware.recordings.layers import open_frame
from firmware.replay.rewriting import Changes, Rewriting
from firmware.topics import Topics

VECTORS = vectors()
RECORDED_NS = 1_795_182_426_461_613_000
NOW_NS = RECORDED_NS + 3_600_000_000_000 + 123_000_000
LATE_MS = 3_600_123
TYPES = Topics()


def octets(kind: str, size: int) -> bytes:
    return next(one.pdu for one in VECTORS if (one.type, len(one.pdu)) == (kind, size))


def fields(pdu: bytes) -> dict[str, tuple[str, str]]:
    """Path -> type and text of each value."""
    from firmware.codec.decoding import Decoder
    from firmware.codec.identify import Identity

    found = Decoder(captain_messages).find(pdu, is_quick=True)
    assert isinstance(found, Identity)
    return {step.path: (step.type, step.text) for step in found.message.explain(pdu) if step.what == "value"}


def changed(pdu: bytes, changes: Changes, when_ns: int | None = RECORDED_NS) -> tuple[bytes, dict[str, str]]:
    """The message after it, and the texts of what is another now."""
    after = Rewriting(changes).apply(Pdu(pdu, "a.hex", when_ns=when_ns), NOW_NS).octets
    before, now = fields(pdu), fields(after)
    assert before.keys() == now.keys()
    return after, {path: now[path][1] for path in before if before[path] != now[path]}


@pytest.mark.parametrize("vector", VECTORS, ids=lambda one: one.name)
def test_nothing_asked_changes_no_octet(vector: Vector):
    one = Pdu(vector.pdu, "a.hex")
    assert Rewriting(Changes()).apply(one, NOW_NS) is one
    assert Rewriting(Changes(station_id=0, is_added=True)).apply(one, NOW_NS).octets == vector.pdu


@pytest.mark.parametrize("vector", VECTORS, ids=lambda one: one.name)
def test_a_station_gets_another_number_wherever_it_names_itself(vector: Vector):
    after, others = changed(vector.pdu, Changes(station_id=4711))
    assert after[2:6] == (4711).to_bytes(4)
    assert set(others.values()) == {"4711"}
    assert len(after) == len(vector.pdu)


def test_a_denm_names_its_station_twice():
    mine = Rewriting(Changes(station_id=4711)).apply(Pdu(octets("denm", 404), "a.hex"), NOW_NS).octets
    _, others = changed(mine, Changes(station_id=1, is_added=True))
    assert others.keys() <= {"header.stationID", "denm.management.actionID.originatingStationID"}
    assert set(others.values()) == {"4712"}


@pytest.mark.parametrize("vector", VECTORS, ids=lambda one: one.name)
def test_there_and_back_gives_the_same_octets(vector: Vector):
    one = Pdu(vector.pdu, "a.hex", when_ns=RECORDED_NS)
    there = Rewriting(Changes(7, True, True, 1000.0, 0.0)).apply(one, NOW_NS)
    back = Rewriting(Changes(2**32 - 7, True, True, -1000.0, 0.0)).apply(there._replace(when_ns=NOW_NS), RECORDED_NS)
    assert back.octets == vector.pdu


def test_a_generation_time_moves_as_far_as_the_replay_is_later():
    cam = octets("cam", 41)
    _, others = changed(cam, Changes(is_now=True))
    (path,) = others
    assert path == "cam.generationDeltaTime"
    before, after = (int(text.split()[0]) for text in (fields(cam)[path][1], others[path]))
    assert after == (before + LATE_MS) % 65536


def test_the_times_of_a_denm_keep_their_distance():
    denm = octets("denm", 404)
    _, others = changed(denm, Changes(is_now=True))
    assert set(others) == {"denm.management.detectionTime", "denm.management.referenceTime"}
    for path, text in others.items():
        assert int(text.split()[0]) == int(fields(denm)[path][1].split()[0]) + LATE_MS


def test_phases_of_traffic_lights_move_along():
    spatem = octets("spatem", 203)
    before = fields(spatem)
    _, others = changed(spatem, Changes(is_now=True))
    kinds = {before[path][0] for path in others}
    assert kinds == {"MinuteOfTheYear", "DSecond", "TimeMark"}
    intersection = "spat.intersections[0]"
    minutes, ms = (
        {key: int(told[path].split()[0]) for key, told in (("old", _texts(before)), ("new", _texts(before) | others))}
        for path in (f"{intersection}.moy", f"{intersection}.timeStamp")
    )
    assert minutes["new"] * 60_000 + ms["new"] - minutes["old"] * 60_000 - ms["old"] == LATE_MS


def _texts(told: dict[str, tuple[str, str]]) -> dict[str, str]:
    return {path: text for path, (_, text) in told.items()}


def test_what_has_no_time_of_recording_is_as_if_it_were_generated_now():
    utc_s = NOW_NS / 1e9
    now = its_time_ms(utc_s, leap_seconds(utc_s))
    _, of_cam = changed(octets("cam", 41), Changes(is_now=True), when_ns=None)
    assert int(of_cam["cam.generationDeltaTime"].split()[0]) == now % 65536
    _, of_denm = changed(octets("denm", 43), Changes(is_now=True), when_ns=None)
    assert int(of_denm["denm.management.detectionTime"].split()[0]) == now


@given(north=st.floats(-1000, 1000), east=st.floats(-1000, 1000))
def test_a_place_moves_by_metres(north: float, east: float):
    cam = octets("cam", 46)
    after, others = changed(cam, Changes(north_m=north, east_m=east))
    assert {path.rsplit(".", 1)[1] for path in others} <= {"latitude", "longitude"}
    was, now = (json.loads(captain_messages.find("cam-1.4.1").to_json(pdu)) for pdu in (cam, after))
    one, other = (told["cam"]["camParameters"]["basicContainer"]["referencePosition"] for told in (was, now))
    assert (other["latitude"] - one["latitude"]) * 0.01113195 == pytest.approx(north, abs=0.02)
    of_longitude = 0.01113195 * math.cos(math.radians(one["latitude"] / 1e7))
    assert (other["longitude"] - one["longitude"]) * of_longitude == pytest.approx(east, abs=0.02)


@pytest.mark.parametrize("north_m", [1e7, -1.6e7])
def test_no_place_is_beyond_a_pole(north_m: float):
    with pytest.raises(RequestError, match="beyond a pole"):
        changed(octets("cam", 46), Changes(north_m=north_m))
    with pytest.raises(RequestError, match="beyond a pole"):
        Rewriting(Changes(north_m=north_m)).apply(
            Pdu(b"", "a.pcap: frame 1", frame=frame_of(octets("cam", 41))), NOW_NS
        )


def frame_of(pdu: bytes, area: Area | None = None) -> bytes:
    mac = bytes.fromhex("02000000000a")
    kind = TYPES.by_number[pdu[1]]
    request = Request(0, kind, pdu, kind.btp_port or 0, 0.0, 60.0, 0, 1, area, 4)
    ego = Ego(700_000_000_000, Position(487_668_616, 114_320_680), is_known=True, speed=1000, heading=900)
    return ethernet.wrap(mac, Sender(mac).encode(request, 0.0, ego))


def test_the_frame_around_a_message_moves_with_it():
    denm = octets("denm", 43)
    whole = frame_of(denm, Area(Shape.CIRCLE, Position(487_668_616, 114_320_680), 500)) + bytes(3)
    one = Pdu(denm, "a.pcap: frame 1", 2002, RECORDED_NS, "gbc_circle, BTP port 2002", whole)
    after = Rewriting(Changes(9, False, True, 100.0, 0.0)).apply(one, NOW_NS)
    found = open_frame(1, after.frame)
    assert getattr(found, "pdu", None) == after.octets != denm
    assert len(after.frame) == len(whole)
    packets = [geonet_packet.parse(octets_[14:]) for octets_ in (whole, after.frame)]
    old, new = (packet.extended for packet in packets)
    assert isinstance(old, geonet_packet.GeoArea)
    assert isinstance(new, geonet_packet.GeoArea)
    assert new.source.timestamp == old.source.timestamp + LATE_MS
    assert new.source.latitude - old.source.latitude == new.latitude - old.latitude == 8983  # 100 m
    assert (new.source.longitude, new.sequence, new.distance_a) == (old.source.longitude, old.sequence, 500)
    assert after.frame[:14] == whole[:14]


def test_a_signed_message_is_not_forged():
    one = Pdu(octets("cam", 41), "a.pcap: frame 1", carried="signed shb, BTP port 2001")
    with pytest.raises(RequestError, match="signed"):
        Rewriting(Changes(station_id=1)).apply(one, NOW_NS)


def test_what_does_not_decode_is_not_changed_by_guess():
    with pytest.raises(RequestError, match="does not decode"):
        Rewriting(Changes(station_id=1)).apply(Pdu(b"\2\2\0\0\0\7\xff", "a.hex"), NOW_NS)


@given(pdu=st.binary(max_size=200), frame=st.binary(max_size=200))
def test_any_octets_are_changed_or_refused(pdu: bytes, frame: bytes):
    rewriting = Rewriting(Changes(1, False, True, 1.0, 1.0))
    whole = ethernet.wrap(bytes(6), frame)
    try:
        after = rewriting.apply(Pdu(pdu, "x", when_ns=1, frame=whole), NOW_NS)
    except RequestError as error:
        assert error.message.startswith("x: ")
    else:
        assert len(after.octets) == len(pdu)
        assert len(after.frame) == len(whole)
