"""Guide of the Python client: its lesson between two stations, its calls of send(), its asyncio program."""

import re
import subprocess
import sys
from pathlib import Path

import captain_messages as messages
import pytest

from captain_client import Station as Client
from captain_client import aio
from tests.documents import blocks
from tests.system.conftest import Bench, Launcher
from tests.system.examples import lines, pdu, plain, running
from tests.system.station import PATIENCE, ROOT, Station
from tests.system.user import mark

PAGE = (ROOT / "firmware/guide/client.md").read_text()
LESSON, AWAITING = blocks(PAGE, "python complete")
LESSON_LINES = 15
POSITION = {"latitude": 48.7668, "longitude": 11.4321}
CAM, DENM = 2, 1  # messageIDs


@pytest.fixture(scope="module")
def bench(launch_shared: Launcher) -> Bench:
    return launch_shared(station={"position": POSITION})


@pytest.fixture(scope="module")
def pair(launch_shared: Launcher) -> tuple[Station, Station]:
    """Return two running stations that hear each other."""
    ports = [launch_shared.port(), launch_shared.port()]
    stations = (launch_shared.station(), launch_shared.station())
    for station, own, other in zip(stations, ports, reversed(ports), strict=True):
        table = {"driver": "udp", "framing": "pdu", "listen": f"127.0.0.1:{own}", "peers": [f"127.0.0.1:{other}"]}
        station.configure({"g5": table})
        station.start()
    return stations


def test_lesson_is_short() -> None:
    assert sum(bool(line.strip()) for line in LESSON.splitlines()) <= LESSON_LINES


def test_lesson_prints_the_own_cam_as_the_other_station_received_it(pair: tuple[Station, Station]) -> None:
    text = LESSON
    for usual, station in zip((":5555", ":5565"), pair, strict=True):
        text = text.replace(usual, f":{station.ports['from_users']}")
    done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert (done.stderr, [done.stdout]) == ("", blocks(PAGE, "text"))


@pytest.mark.parametrize("station", [Client, aio.Station])
def test_guide_names_only_members_that_both_forms_have(station: type) -> None:
    assert [name for name in re.findall(r"\bbox\.(\w+)", PAGE) if not hasattr(station, name)] == []


def test_calls_of_send_in_the_guide_put_their_messages_on_the_air(bench: Bench) -> None:
    whole = messages.find("cam")
    names = {"octets": mark(), "whole": plain(pdu("cam", **POSITION))}
    with Client(f":{bench.station.ports['from_users']}") as box:
        calls = [line for line in blocks(PAGE, "python send")[0].splitlines() if line]
        for call in calls:
            assert eval(call, {"box": box, **names}).confirmed().sent == ("g5",)
    heard = [bench.air.hear().pdu for _ in calls]
    assert [octets[1] for octets in heard] == [CAM, DENM, CAM, CAM, CAM]
    assert [octets[0] for octets in heard] == [2, 2, messages.find("cam-2.3.1").versions[0], 2, 2]
    speed = "cam.camParameters.highFrequencyContainer.basicVehicleContainerHighFrequency.speed.speedValue"
    assert whole.reader(speed)(heard[0]) == (1390,)
    assert heard[4] == names["octets"]


def test_asyncio_program_of_the_guide_sends_and_receives(bench: Bench, tmp_path: Path) -> None:
    (tmp_path / "awaiting.py").write_text(AWAITING)
    with running(tmp_path / "awaiting.py", f":{bench.station.ports['from_users']}") as child:
        said = lines(child, lambda: bench.air.send(pdu("cam", station=7, speed=13.9)))
        first, second = next(said), next(said)
    assert re.match(r"Confirmed\(.*sent=\('g5',\)", first)
    assert second == "7 13.9"
