"""Blocking client with a station: messages both ways, confirms, reports, errors."""

import contextlib
import json
import signal
import time
from collections.abc import Callable, Iterator

import captain_messages
import pytest

from captain_client import RefusedError, Station, StationError, UnconfirmedError, UnreachableError
from captain_client.message import Message
from captain_client.station import Subscription
from tests.firmware.captain_client.places import address_of
from tests.firmware.captain_client.test_reception import TOLD
from tests.system.air import Air
from tests.system.conftest import Bench, Launcher
from tests.system.ports import Ports
from tests.system.station import PATIENCE
from tests.system.user import mark

CAM = bytes.fromhex("02029b260aa393e6005a6f0da4ae7bfb35a238230a6a3d4290581a90a3f67e02e6928b37fee9fea6103fdf93d980")
POSITION = {"latitude": 48.7668, "longitude": 11.4321}


@pytest.fixture(scope="module")
def bench(launch_shared: Launcher) -> Bench:
    return launch_shared(station={"id": 4711, "position": POSITION})


@pytest.fixture
def air(bench: Bench) -> Air:
    return bench.settled().air


@pytest.fixture
def box(bench: Bench) -> Iterator[Station]:
    with Station(address_of(bench), control=str(bench.station.control)) as station:
        yield station


# -- sending


def test_pdu_reaches_the_air_and_is_confirmed_by_its_interface(box: Station, air: Air):
    confirmed = box.send("cam", pdu := mark()).confirmed()
    assert air.hear().pdu == pdu
    assert (confirmed.type, confirmed.sent, confirmed.dropped) == ("cam", ("g5",), {})


def test_messages_that_are_sent_just_before_the_end_of_the_program_reach_the_air(bench: Bench, air: Air):
    pdus = [mark() for _ in range(100)]
    with Station(address_of(bench)) as station:
        for pdu in pdus:
            station.send("cam", pdu)
    assert [air.hear().pdu for _ in pdus] == pdus


def test_message_by_short_names_has_the_position_and_number_of_the_station(box: Station, air: Air):
    box.send("cam", speed=13.9, heading=90.0).confirmed()
    cam = Message(air.hear().pdu, TOLD)
    values = {name: cam.get(name) for name in ("speed", "heading", "station", *POSITION)}
    assert values == {"speed": 13.9, "heading": 90.0, "station": 4711, **POSITION}


def test_message_as_a_dict_in_another_edition_reaches_the_air(box: Station, air: Air):
    edition = captain_messages.find("cam-1.3.2")
    pdu = edition.encode(edition.example(station=7, time=1.0, latitude=48.7, longitude=11.4))
    box.send("cam", json.loads(edition.to_json(pdu)), form="json", edition="cam-1.3.2").confirmed()
    assert air.hear().pdu == pdu


def test_refused_message_raises_with_all_faults(box: Station):
    with pytest.raises(RefusedError) as refused:
        box.send("cam", speed=999.0, station_type="tank").confirmed()
    assert refused.value.reason == "bad-json"
    assert len(refused.value.invalid) == 2
    assert all(set(fault) == {"path", "problem", "value"} for fault in refused.value.invalid)


def test_message_for_an_unknown_interface_raises_with_the_known_ones(box: Station):
    with pytest.raises(RefusedError, match="one of g5"):
        box.send("cam", mark(), options={"interfaces": ["g6"]}).confirmed()


def test_confirms_of_many_messages_are_found_in_any_order(box: Station, air: Air):
    sent = [box.send("cam", mark()) for _ in range(300)]
    assert {one.confirmed().sent for one in reversed(sent)} == {("g5",)}
    for _ in sent:
        air.hear()


# -- receiving


def test_message_that_is_sent_after_listen_returns_is_received(box: Station, air: Air):
    with box.listen("cam", timeout_s=PATIENCE) as cams:
        air.send(CAM)
        cam = next(cams)
    assert (cam.pdu, cam.type, cam.station, cam.interface) == (CAM, "cam", 2602961571, "g5")
    assert (cam.edition, cam.get("latitude"), cam.missed) == ("cam-1.4.1", 50.0401189, 0)
    assert abs(cam.received_ns - time.time_ns()) < 5e9


def test_listen_to_a_type_skips_others_and_listen_to_all_does_not(box: Station, air: Air):
    denm = bytes((2, 1)) + mark()[2:]
    with box.listen("denm", timeout_s=PATIENCE) as denms, box.listen(timeout_s=PATIENCE) as messages:
        air.send(pdu := mark())
        air.send(denm, 2002)
        assert next(denms).pdu == denm
        assert [next(messages).pdu for _ in range(2)] == [pdu, denm]


def test_listen_ends_when_no_message_arrives_within_the_timeout(box: Station):
    assert list(box.listen("spatem", timeout_s=0.05)) == []


@pytest.mark.parametrize("kind", ["", "CAM", "cam.", "cam-1.4.1", "x" * 256])
def test_listen_to_an_invalid_type_raises_value_error(box: Station, kind: str):
    with pytest.raises(ValueError, match="invalid message type"):
        box.listen(kind)


def test_subscription_to_an_unknown_type_raises_value_error_with_the_nearest_one(box: Station):
    for subscribe in (box.listen, box.indications, box.confirms):
        with pytest.raises(ValueError, match=r"^types: 'camm': unknown to the station; did you mean cam\?$"):
            subscribe("denm", "camm")


def test_indications_confirms_and_frames_are_reports_of_the_station(box: Station, air: Air):
    wait = {"timeout_s": PATIENCE}
    with (
        box.indications("cam", **wait) as indications,
        box.confirms("cam", **wait) as confirms,
        box.frames("g5", **wait) as frames,
    ):
        air.send(pdu := mark())
        assert next(indications)["station_id"] == int.from_bytes(pdu[2:6], "big")
        frame = next(frames)
        assert (frame.report["direction"], pdu in frame.octets) == ("in", True)
        sent = box.send("cam", mark())
        assert [next(confirms)["label"] for _ in range(2)] == [sent.label, sent.label]
    air.hear()


def test_status_and_time_are_objects_of_the_station(box: Station):
    assert box.status()["interfaces"]["g5"]["state"] == "up"
    assert box.time()["state"] == "system"


# -- commands


def test_reload_reads_the_policy_again(box: Station, bench: Bench):
    box.reload_policy()
    kept = bench.station.file.read_text()
    bench.station.file.write_text(kept + '\n[[policy]]\ntypes = ["no such type"]\n')
    with pytest.raises(RefusedError):
        box.reload_policy()
    bench.station.file.write_text(kept)


def test_trigger_without_a_recorder_is_refused(box: Station):
    with pytest.raises(RefusedError, match="no recorder"):
        box.trigger("near miss")
    with pytest.raises(ValueError, match=r"^text: b'near miss' is not a text"):
        box.trigger(b"near miss")  # type: ignore[arg-type]


# -- failures


def test_station_that_is_not_there_is_unreachable_within_the_timeout():
    ports = Ports()
    with pytest.raises(UnreachableError, match="Connection refused"):
        Station(f":{ports.take()}", timeout_s=0.1)
    ports.release()


@pytest.mark.parametrize("address", ["5555", "tcp://captain-7.local", "a b"])
def test_station_with_an_invalid_address_raises_value_error(address: str):
    with pytest.raises(ValueError, match=r"invalid|without"):
        Station(address, timeout_s=0.1)


def test_restart_of_the_station_ends_its_open_requests_and_the_client_goes_on(launch: Launcher):
    bench = launch()
    with Station(address_of(bench)) as box:
        bench.station.signal(signal.SIGSTOP)  # the request reaches its socket and is never confirmed
        lost = box.send("cam", mark())
        bench.station.kill()
        bench.station.start()
        with pytest.raises(UnconfirmedError, match="restarted"):
            lost.confirmed(timeout_s=PATIENCE)
        assert box.send("cam", mark()).confirmed().sent == ("g5",)


def test_restart_of_the_station_counts_the_messages_that_were_missed_until_the_reconnection(launch: Launcher):
    bench = launch()
    with Station(address_of(bench)) as box, box.listen("cam", timeout_s=0.02) as cams:
        bench.air.send(mark())
        assert awaited(cams).missed == 0
        bench.station.stop()
        bench.station.start()
        cam = awaited(cams, lambda: bench.air.send(mark()))
        received = 1 + len(list(cams))
        assert box.missed == cam.missed
        assert box.missed + received == bench.station.status()["endpoint"]["published"]


def awaited(messages: Subscription[Message], meanwhile: Callable[[], object] = lambda: None) -> Message:
    """Return the next message. Calls meanwhile() after each timeout of the subscription."""
    end = time.monotonic() + PATIENCE
    while (message := next(messages, None)) is None:
        assert time.monotonic() < end
        meanwhile()
    return message


def test_message_of_a_stopped_station_raises_unreachable(launch: Launcher):
    bench = launch()
    with Station(address_of(bench), timeout_s=0.2) as box:
        bench.station.stop()
        with pytest.raises(UnreachableError):
            send_until_refused(box)


def send_until_refused(box: Station) -> None:
    """Send until send() raises: libzmq may take messages until it has noticed the end of the connection."""
    while True:
        with contextlib.suppress(UnconfirmedError):
            box.send("cam", mark()).confirmed(timeout_s=0.1)


def test_error_is_told_with_its_remedy():
    assert str(StationError("g5: link down", "check the antenna")) == "g5: link down\n  (check the antenna)"
