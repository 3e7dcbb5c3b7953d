"""Examples of firmware/guide/tasks.md, each against a running station: shown in the guide, short, and effective."""

import csv
import itertools
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from tests.broker.client import Client
from tests.broker.fixtures import Brokers
from tests.system.conftest import Launcher
from tests.system.examples import (
    FOLDER,
    G5,
    LATITUDE,
    LONGITUDE,
    V2N,
    ExampleBench,
    TimedBench,
    heard,
    lines,
    pdu,
    running,
)
from tests.system.station import PATIENCE, ROOT
from tests.system.user import JOIN_MS

CAM, SSEM = 2, 10  # messageIDs
NAMES = sorted(path.name for path in FOLDER.glob("*.py"))
PAGE = (ROOT / "firmware/guide/tasks.md").read_text()
SHOWN = dict(re.findall(r"^```python complete\n(?=# (\w+\.py))(.*?)^```", PAGE, re.M | re.S))
LONGEST = 30  # lines

METRES_PER_DEGREE = 111_320
GPX = """<?xml version="1.0"?><gpx version="1.1" xmlns="http://www.topografix.com/GPX/1/1"><trk><trkseg>
<trkpt lat="48.7668" lon="11.4320"><time>2026-05-04T08:00:00.0Z</time></trkpt>
<trkpt lat="48.7669" lon="11.4320"></trkpt>
<trkpt lat="48.7669" lon="11.4320"><time>2026-05-04T08:00:00.2Z</time></trkpt>
<trkpt lat="48.7669" lon="11.4320"><time>2026-05-04T08:00:00.2Z</time></trkpt>
<trkpt lat="48.7670" lon="11.4320"><time>2026-05-04T08:00:00.4Z</time></trkpt>
</trkseg></trk></gpx>"""


@pytest.fixture(scope="module")
def bench(launch_shared: Launcher, tmp_path_factory: pytest.TempPathFactory) -> ExampleBench:
    return ExampleBench(launch_shared, tmp_path_factory.mktemp("ring"))


@pytest.fixture(scope="module", autouse=True)
def timed(launch_shared: Launcher) -> Iterator[TimedBench]:
    """Return a second station. It starts first, because its receiver gives the time after a second."""
    with closing(TimedBench(launch_shared)) as bench:
        yield bench


def test_guide_shows_every_example_word_for_word() -> None:
    assert {name: (FOLDER / name).read_text() for name in NAMES} == SHOWN


@pytest.mark.parametrize("name", NAMES)
def test_example_has_at_most_30_lines(name: str) -> None:
    assert len((FOLDER / name).read_text().splitlines()) <= LONGEST


def said_at_the_end(name: str, *arguments: object) -> str:
    """Return what an example says that must end by itself with an error, without a traceback."""
    command = [sys.executable, FOLDER / name, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode in {1, 2}
    assert "Traceback" not in done.stderr
    return done.stderr.rstrip("\n")


@pytest.mark.parametrize("name", [name for name in NAMES if f"# {name} [STATION]" not in (FOLDER / name).read_text()])
def test_example_without_its_arguments_says_its_usage(name: str) -> None:
    assert said_at_the_end(name).startswith(f"usage: {name}")


@pytest.fixture
def arguments(name: str, tmp_path: Path) -> tuple[object, ...]:
    """Return valid arguments of an example, before its station."""
    (tmp_path / "track.gpx").write_text(GPX)
    own: dict[str, tuple[object, ...]] = {
        "answer_srem.py": (12,),
        "gpx_cams.py": (tmp_path / "track.gpx",),
        "lamp.py": (12, 3),
        "latency.py": (5,),
        "losses.py": (5, ":1"),
        "relay_mqtt.py": ("cam", 1),
        "time_bound.py": (1.0,),
    }
    return own.get(name, ())


@pytest.mark.parametrize("name", NAMES)
def test_example_without_a_station_ends_with_an_error_only(name: str, arguments: tuple[object, ...]) -> None:
    command = [sys.executable, FOLDER / name, *map(str, arguments), ":1"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (1, "")
    assert re.match(r"captain: [^\n]*127\.0\.0\.1:4\b", done.stderr)
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("name", NAMES)
def test_example_with_ctrl_c_ends_without_a_word(name: str, arguments: tuple[object, ...]) -> None:
    with (
        socket.create_server(("127.0.0.1", 0)) as silent,
        running(name, *arguments, f":{silent.getsockname()[1] - 3}") as child,
    ):
        silent.settimeout(PATIENCE)
        silent.accept()[0].close()  # the example waits for a status of this station
        child.send_signal(signal.SIGINT)
        said, complained = child.communicate(timeout=PATIENCE)
    assert (child.returncode, said, complained) == (0, "", "")


def test_relay_without_a_broker_ends_with_an_error_of_one_line(bench: ExampleBench) -> None:
    assert re.fullmatch(r"MQTT broker at port 1: .*refused", said_at_the_end("relay_mqtt.py", "cam", 1, bench.address))


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("answer_srem.py", ["x"]),
        ("lamp.py", ["12", "x"]),
        ("latency.py", ["x"]),
        ("losses.py", ["x", ":5555", ":5565"]),
        ("relay_mqtt.py", ["cam", "x"]),
        ("time_bound.py", ["x"]),
    ],
)
def test_example_with_a_text_for_a_number_says_which_argument(name: str, arguments: list[str]) -> None:
    assert re.search(r": error: argument \w+: invalid \w+ value: 'x'$", said_at_the_end(name, *arguments))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (None, "No such file"),
        ("no XML", "syntax error"),
        (GPX.replace('lat="48.7669"', ""), "'lat'"),
        (GPX.replace("48.7669", "north"), "north"),
        (GPX.replace("2026-05-04", "today "), "today"),
        (re.sub("<time>.*</time>", "", GPX), "fewer than two track points with a time"),
        (re.sub("<trkpt.*", "", GPX), "fewer than two track points with a time"),
    ],
)
def test_gpx_file_without_a_track_is_an_error_of_one_line(tmp_path: Path, text: str | None, said: str) -> None:
    path = tmp_path / "track.gpx"
    if text is not None:
        path.write_text(text)
    (line,) = said_at_the_end("gpx_cams.py", path).splitlines()
    assert said in line
    assert path.name in line


def test_gpx_track_is_sent_as_cams_every_tenth_of_a_second(bench: ExampleBench, tmp_path: Path) -> None:
    (tmp_path / "track.gpx").write_text(GPX)
    with running("gpx_cams.py", tmp_path / "track.gpx", bench.address) as child:
        cams = [heard(bench.airs[G5], CAM)["cam"]["camParameters"] for _ in range(4)]
        assert child.wait(PATIENCE) == 0
    places = [cam["basicContainer"]["referencePosition"] for cam in cams]
    assert [place["latitude"] for place in places] == pytest.approx([48.7668, 48.76685, 48.7669, 48.76695], abs=1e-7)
    assert {place["longitude"] for place in places} == {11.432}
    motions = [cam["highFrequencyContainer"]["basicVehicleContainerHighFrequency"] for cam in cams]
    assert [one["speed"]["speedValue"] for one in motions] == pytest.approx(
        [0.0001 * METRES_PER_DEGREE / 0.2] * 4, abs=0.01
    )
    assert {one["heading"]["headingValue"] for one in motions} == {0}


def test_denm_ahead_is_warned_of_and_one_behind_far_away_ended_or_without_a_place_is_not(bench: ExampleBench) -> None:
    at = {"ahead": (7, 0.002), "behind": (8, -0.002), "far": (9, 0.01)}  # stationID, degrees east of the station
    denms = [
        pdu("denm", station=station, latitude=LATITUDE, longitude=LONGITUDE + east, cause=94)
        for station, east in at.values()
    ]
    denms.insert(0, pdu("denm", station=6, latitude="unavailable", longitude="unavailable", cause=94))
    east = at["ahead"][1]
    denms.insert(
        0,
        pdu("denm", station=5, latitude=LATITUDE, longitude=LONGITUDE + east, termination="isCancellation"),
    )

    def meet() -> None:
        bench.drive()
        for denm in denms:
            bench.airs[G5].send(denm)

    with running("warn_denm.py", bench.address) as child:
        warned = list(itertools.islice(lines(child, meet), 2))
    distance_m = 0.002 * METRES_PER_DEGREE * 0.659  # cosine of 48.7668 degrees
    assert warned == [f"station 7: cause 94, {distance_m:.0f} m ahead"] * 2


def test_all_stations_are_rows_of_the_csv_file(bench: ExampleBench) -> None:
    cams = [pdu("cam", station=station, latitude=48.7, longitude=11.4, speed=station) for station in (7, 8)]
    with running("csv_stations.py", bench.address) as child:
        said = lines(child, lambda: [bench.airs[G5].send(cam) for cam in cams])
        rows = list(csv.DictReader(itertools.islice(said, 5)))
        child.send_signal(signal.SIGINT)
        assert child.wait(PATIENCE) == 0
    assert {(row["station"], row["speed"]) for row in rows} == {("7", "7"), ("8", "8")}
    assert {(row["latitude"], row["longitude"], row["interface"]) for row in rows} == {("48.7", "11.4", G5)}


def test_mean_latency_of_v2n_against_g5_is_printed(bench: ExampleBench) -> None:
    number = itertools.count()
    late: list[bytes] = []

    def send() -> None:
        """Send the previous message by V2N and a new one by G5: V2N is late by a pause of lines()."""
        for cam in late:
            bench.airs[V2N].send(cam)
        late[:] = [pdu("cam", station=7, speed=next(number) / 10)]
        bench.airs[G5].send(late[0])

    with running("latency.py", 5, bench.address) as child:
        said = next(lines(child, send))
    found = re.fullmatch(r"v2n is (.*) ms later than g5: mean of 5 messages", said)
    assert found is not None, said
    assert float(found[1]) >= JOIN_MS


def test_lost_messages_between_two_stations_are_counted(bench: ExampleBench, timed: TimedBench) -> None:
    with running("losses.py", 20, bench.address, timed.address) as child:
        for number in range(20):
            octets = bench.airs[G5].hear().pdu
            if number % 10:
                timed.air.send(octets)
        said = next(lines(child, lambda: None))
    assert said == "sent 20, received 18; this program missed 0 CAMs of all stations"


def test_lost_messages_beside_foreign_cams_are_those_of_the_own_car(bench: ExampleBench, timed: TimedBench) -> None:
    with running("losses.py", 20, bench.address, timed.address) as child:
        for number in range(20):
            octets = bench.airs[G5].hear().pdu
            timed.air.send(pdu("cam", station=7, speed=number))
            if number % 10:
                timed.air.send(octets)
        said = next(lines(child, lambda: None))
    assert said == "sent 20, received 18; this program missed 0 CAMs of all stations"


def test_lamp_is_on_while_the_signal_group_of_the_intersection_is_red(bench: ExampleBench) -> None:
    states = [
        pdu("spatem", intersection=intersection, signal_group=group, event_state=state)
        for intersection, group, state in (
            (11, 3, "permissive-Movement-Allowed"),
            (12, 3, "stop-And-Remain"),
            (11, 3, "permissive-Movement-Allowed"),
            (12, 4, "permissive-Movement-Allowed"),
            (13, 3, "stop-And-Remain"),
            (12, 3, "permissive-Movement-Allowed"),
            (11, 3, "stop-And-Remain"),
        )
    ]
    with running("lamp.py", 12, 3, bench.address) as child:
        said = list(itertools.islice(lines(child, lambda: [bench.airs[G5].send(one) for one in states]), 3))
    assert said == ["lamp on", "lamp off", "lamp on"]


def test_one_type_is_relayed_to_mqtt(bench: ExampleBench, brokers: Brokers) -> None:
    broker = brokers()
    both = [pdu("denm", station=8, latitude=48.7, longitude=11.4), pdu("cam", station=7, speed=13.9)]
    with Client(broker.plain_port).subscribe("v2x/#") as client:
        with running("relay_mqtt.py", "cam", broker.plain_port, bench.address):
            while client.messages.empty():
                for octets in both:
                    bench.airs[G5].send(octets)
                time.sleep(JOIN_MS / 1000)
        message = client.next()
    assert message.topic == "v2x/cam/7"
    assert b'"speedValue": 13.9' in message.payload


def test_srem_for_the_intersection_is_answered_and_another_one_is_not(bench: ExampleBench) -> None:
    srems = [
        pdu("srem", station=7, intersection=intersection, request=3, sequence_number=5, in_lane=2)
        for intersection in (11, 12)
    ]
    with running("answer_srem.py", 12, bench.address) as child:
        said = next(lines(child, lambda: [bench.airs[G5].send(srem) for srem in srems]))
        (status,) = heard(bench.airs[G5], SSEM)["ssm"]["status"]
    assert said == "station 7: granted by g5, v2n"
    requester = {"id": {"stationID": 7}, "request": 3, "sequenceNumber": 5}
    assert (status["id"], status["sigStatus"]) == (
        {"id": 12},
        [{"requester": requester, "inboundOn": {"lane": 2}, "status": "granted"}],
    )


def test_hard_braking_makes_the_recorder_keep_its_file(bench: ExampleBench) -> None:
    cams = [pdu("cam", station=7, acceleration=-1.0), pdu("cam", station=8, acceleration=-6.0)]
    with running("keep_braking.py", bench.address) as child:
        said = next(lines(child, lambda: [bench.airs[G5].send(cam) for cam in cams]))
    assert said == "station 8 brakes at -6 m/s2"
    bench.station.until(lambda status: status["recorder"]["kept"] > 0)
    assert [path for path in bench.folder.iterdir() if path.name.endswith("braking-of-station-8.pcapng")]


def test_error_bound_of_a_station_without_time_is_unknown(bench: ExampleBench) -> None:
    with running("time_bound.py", 1000, bench.address) as child:
        said = next(lines(child, lambda: None))
    assert re.fullmatch(r"not good: (unknown|system), error at most unknown", said)


def test_error_bound_of_a_receivers_time_is_watched(timed: TimedBench) -> None:
    with running("time_bound.py", 1000, timed.address) as child:
        # The receiver needs a second. Until then, the bound is unknown.
        said = next(line for line in lines(child, lambda: None) if not line.startswith("not good"))
    assert re.fullmatch(r"good: coarse, error at most \d+\.\d{3} ms", said)
