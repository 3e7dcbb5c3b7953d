"""A swarm on a clock that jumps: what it sends, and that others can read it."""

import json
from contextlib import suppress
from math import inf

import captain_messages
import pytest

from board.runtime.errors import RequestError
from drivers.message import Area, Ego, Position
from drivers.sim.track import Point
from drivers.wire import frame as ethernet
from drivers.wire.geonet.protocol import GeoNetworking, Mib, Received
from firmware.swarm import tracks
from firmware.swarm.messages import CPMS, MOST_OBJECTS, Writer
from firmware.swarm.swarm import Plan, Swarm
from firmware.swarm.vehicle import Style, Vehicle

START_UNIX = 1_795_182_426.0
CENTRE = Point(48.7668616, 11.4320680, 420.0)
NOWHERE = Ego(0, Position(), is_known=False)


class Run:
    """A swarm that has driven so many seconds, or been ended before; sent: seconds, vehicle, type, PDU and area of each."""

    def __init__(
        self, count: int, plan: Plan, duration: float, swing: float = 5.0, ends_at: float = inf, cpm: str = "cpm-2.1.1"
    ) -> None:
        self.now = 50.0
        self._end = 50.0 + ends_at
        self.sent: list[tuple[float, Vehicle, str, bytes, Area | None]] = []
        self.frames: list[bytes] = []
        writer = Writer(cpm)
        ways = tracks.town(CENTRE, count)
        self.vehicles = [
            Vehicle(at, 1000 + at, way, Style(10.0, swing, 20.0, at * 37.0), writer) for at, way in enumerate(ways)
        ]
        swarm = Swarm(self.vehicles, plan, writer, self._out, lambda: self.now, self._wall, self._sleep)
        self.told = swarm.sent
        self.seconds = 0
        with suppress(KeyboardInterrupt):
            for _ in swarm.run(duration):
                self.seconds += 1

    def _out(self, vehicle, kind, pdu, now, its_ms, area):
        self.sent.append((self.now - 50.0, vehicle, kind.name, pdu, area))
        self.frames.append(vehicle.frame(kind, pdu, now, its_ms, area))

    def _wall(self) -> float:
        return START_UNIX + self.now - 50.0

    def _sleep(self, seconds: float) -> None:
        self.now += seconds
        if self.now >= self._end:
            raise KeyboardInterrupt

    def of(self, kind: str) -> list[tuple[float, bytes]]:
        return [(when, pdu) for when, _, name, pdu, _ in self.sent if name == kind]


def value(edition: str, pdu: bytes):
    message = captain_messages.find(edition)
    message.validate(pdu)
    return json.loads(message.to_json(pdu))


def test_a_fixed_rate_is_kept_to_the_message_and_spread_over_its_period():
    run = Run(20, Plan(cam_hz=10.0), 5.0)
    assert run.told.types == {"cam": 1000}
    assert set(run.told.stations.values()) == {50}
    assert [when for when, *_ in run.sent] == pytest.approx([at * 0.005 for at in range(1000)])
    assert (run.told.late, run.told.latest_s) == (0, pytest.approx(0, abs=1e-6))


def test_what_ends_it_between_two_seconds_leaves_the_right_duration():
    run = Run(1, Plan(cam_hz=10.0), 5.0, ends_at=1.5)
    assert run.told.seconds == pytest.approx(1.5)


def test_by_the_rules_each_sends_between_one_and_ten_a_second():
    run = Run(10, Plan(), 30.0)
    for count in run.told.stations.values():
        assert 30 <= count <= 300
    assert 600 < run.told.total < 1500  # 10 m/s: one for 4 m, up to the next check


def test_every_message_keeps_its_standard_and_tells_what_the_vehicle_does():
    run = Run(4, Plan(), 12.0)
    cams = [value("cam-1.4.1", pdu) for _, pdu in run.of("cam")]
    assert {one["header"]["stationID"] for one in cams} == {1000, 1001, 1002, 1003}
    parameters = [one["cam"]["camParameters"] for one in cams]
    speeds = [
        one["highFrequencyContainer"]["basicVehicleContainerHighFrequency"]["speed"]["speedValue"] for one in parameters
    ]
    assert min(speeds) >= 500
    assert max(speeds) <= 1500
    paths = [
        one["lowFrequencyContainer"]["basicVehicleContainerLowFrequency"]["pathHistory"]
        for one in parameters
        if "lowFrequencyContainer" in one
    ]
    assert 4 * 12 <= len(paths) <= 4 * 25
    assert max(map(len, paths)) >= 4
    assert len(paths[0]) == 0


@pytest.mark.parametrize("name", CPMS)
def test_cpms_are_of_the_edition_that_is_asked_for(name: str):
    pdus = [pdu for _, pdu in Run(3, Plan(cam_hz=1.0, cpm_hz=1.0), 3.0, cpm=name).of("cpm")]
    assert pdus
    assert all(captain_messages.find(name).encode(captain_messages.find(name).decode(pdu)) == pdu for pdu in pdus)


def test_a_path_history_leads_back_to_where_the_vehicle_was():
    run = Run(1, Plan(cam_hz=10.0), 20.0, swing=0.0)
    places, latest = [], None
    for _, pdu in run.of("cam"):
        latest = value("cam-1.4.1", pdu)["cam"]["camParameters"]
        place = latest["basicContainer"]["referencePosition"]
        places.append((place["latitude"], place["longitude"]))
        if "lowFrequencyContainer" in latest:
            at = places[-1]
            for point in latest["lowFrequencyContainer"]["basicVehicleContainerLowFrequency"]["pathHistory"]:
                delta = point["pathPosition"]
                at = at[0] + delta["deltaLatitude"], at[1] + delta["deltaLongitude"]
                assert at in places


def test_the_frames_are_received_as_those_of_any_station():
    run = Run(3, Plan(cam_hz=2.0, cpm_hz=1.0, denm_hz=1.0), 5.0)
    receiver = GeoNetworking(bytes(6), Mib(beacon_s=0.0))
    for octets, (_, vehicle, kind, pdu, area) in zip(run.frames, run.sent, strict=True):
        parts = ethernet.unwrap(octets)
        assert isinstance(parts, ethernet.Ethernet)
        event = receiver.receive(parts.packet, parts.source, 0.0, 0, lambda: NOWHERE)
        assert isinstance(event, Received)
        assert (event.pdu, event.rx.source_mac) == (pdu, vehicle.mac)
        assert event.rx.btp_port == {"cam": 2001, "denm": 2002, "cpm": 2009}[kind]
        assert event.rx.transport == ("shb" if area is None else "gbc")


def test_an_event_is_told_ten_times_a_second_apart_and_then_cancelled():
    run = Run(2, Plan(cam_hz=1.0, denm_hz=0.02, seed=4), 120.0)
    events: dict[int, list[tuple[float, dict]]] = {}
    for when, pdu in run.of("denm"):
        told = value("denm-1.3.1", pdu)["denm"]
        events.setdefault(told["management"]["actionID"]["sequenceNumber"], []).append((when, told))
    whole = [one for one in events.values() if one[0][0] < 109]
    assert whole
    for one in whole:
        assert len(one) == 11
        assert [when - one[0][0] for when, _ in one] == pytest.approx(range(11))
        assert ["termination" in told["management"] for _, told in one] == [False] * 10 + [True]
        assert len({told["management"]["detectionTime"] for _, told in one}) == 1
        assert len({json.dumps(told["management"]["eventPosition"]) for _, told in one}) == 1


def test_a_cpm_has_the_others_around_with_their_numbers():
    run = Run(10, Plan(cam_hz=1.0, cpm_hz=1.0), 3.0)
    seen = 0
    for _, pdu in run.of("cpm"):
        told = value("cpm-2.1.1", pdu)
        for container in told["payload"]["cpmContainers"][1:]:
            objects = container["containerData"]["perceivedObjects"]
            assert len(objects) == container["containerData"]["numberOfPerceivedObjects"] <= MOST_OBJECTS
            assert told["header"]["stationId"] - 1000 not in [one["objectId"] for one in objects]
            seen += len(objects)
    assert seen > 20


def test_the_same_seed_gives_the_same_messages_again():
    one, other = (Run(5, Plan(denm_hz=0.5, seed=3), 8.0) for _ in range(2))
    assert [pdu for *_, pdu, _ in one.sent] == [pdu for *_, pdu, _ in other.sent]


def test_what_comes_late_is_sent_all_the_same_and_told():
    run = Run(1, Plan(cam_hz=10.0), 0.0)
    vehicle, now = run.vehicles[0], [0.0]

    def slow(*_: object) -> None:
        now[0] += 0.25  # takes longer than the period

    swarm = Swarm([vehicle], Plan(cam_hz=10.0), Writer(), slow, lambda: now[0], lambda: START_UNIX, lambda _: None)
    for _ in swarm.run(2.0):
        pass
    assert swarm.sent.total == 20
    assert swarm.sent.late == 19
    assert swarm.sent.latest_s == pytest.approx(19 * 0.15)


def test_a_way_is_read_from_a_file_and_its_mistakes_are_named(tmp_path):
    path = tmp_path / "way.txt"
    path.write_text("# there and back\n48.7668, 11.4320\n48.7768, 11.4320, 400\n")
    assert tracks.read(path).length_m == pytest.approx(2 * 1113.2, abs=0.5)
    for text, told in (("48.7668;11.4", "line 1"), ("91,11", "out of range"), ("# none\n", "no place")):
        path.write_text(text)
        with pytest.raises(RequestError, match=told):
            tracks.read(path)
