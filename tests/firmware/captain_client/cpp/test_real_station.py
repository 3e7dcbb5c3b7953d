"""The C++ client with running stations: the lesson of its guide, confirms, received messages and a restart."""

import select
import subprocess
from pathlib import Path

import captain_messages as messages
import pytest

from tests.documents import blocks
from tests.firmware.captain_client.cpp.driver import Driver, Installed
from tests.system.conftest import Bench, Launcher
from tests.system.station import PATIENCE, ROOT
from tests.system.user import JOIN_MS

EXAMPLES = ROOT / "firmware/guide/examples"
LESSON = EXAMPLES / "lesson.cpp"
LINES = 15
GUIDE = ROOT / "firmware/guide/client-cpp.md"
OWN = 1234  # stationID of the lesson
PLACE = {"latitude": 48.7668, "longitude": 11.4321}


@pytest.fixture(scope="module")
def bench(launch_shared: Launcher) -> Bench:
    return launch_shared(station={"id": 4711})


@pytest.fixture(scope="session")
def lesson(installed: Installed, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the program of the lesson, compiled with the flags of pkg-config."""
    return installed.compiled(LESSON, tmp_path_factory.mktemp("lesson") / "lesson")


def address(bench: Bench) -> str:
    return f":{bench.station.ports['from_users']}"


def pdu(kind: str, **fields: object) -> bytes:
    message = messages.find(kind)
    octets: bytes = message.encode(message.example(**fields))
    return octets


def received(bench: Bench, driver: Driver, octets: bytes) -> dict[str, object]:
    """Send a message again and again until the listener of the driver has it; return it."""
    driver.tell("next")
    message: dict[str, object] = driver.line_after(lambda: bench.air.send(octets))["said"]
    return message


def test_guide_shows_its_programs_word_for_word() -> None:
    assert blocks(GUIDE.read_text(), "cpp complete") == [
        (EXAMPLES / name).read_text() for name in ("lesson.cpp", "structs.cpp")
    ]


def test_lesson_is_short() -> None:
    lines = LESSON.read_text().splitlines()
    assert len([line for line in lines if line.strip() and not line.startswith("//")]) <= LINES


def test_lesson_shows_the_own_message_as_the_other_station_has_received_it(
    bench: Bench, launch_shared: Launcher, lesson: Path
) -> None:
    other = launch_shared()
    with subprocess.Popen([lesson, address(bench), address(other)], stdout=subprocess.PIPE, text=True) as child:
        while child.poll() is None:
            while select.select([bench.air.socket], [], [], JOIN_MS / 1000)[0]:
                other.air.send(bench.air.hear().pdu)
        said = child.communicate(timeout=PATIENCE)[0]
    assert (child.returncode, said) == (0, f"station {OWN} at 27.78 m/s by g5\n")


def test_message_of_fields_is_sent_with_what_the_station_knows(bench: Bench, program: Path) -> None:
    bench.settled()
    driver = Driver(program, address(bench))
    assert driver.line() == {"said": "connected"}
    driver.ask("send", type="cam-1.4.1", fields={"speed": 13.9, **PLACE}, options={"interfaces": ["g5"]})
    assert driver.ask("confirmed") == {"sent": ["g5"], "dropped": []}
    sent = messages.find("cam-1.4.1").decode(bench.air.hear().pdu)
    assert sent["header"]["stationID"] == 4711
    container = sent["cam"]["camParameters"]["highFrequencyContainer"][1]
    assert container["speed"]["speedValue"] == 1390
    driver.close()


def test_message_of_invalid_fields_is_refused_with_each_of_them(bench: Bench, program: Path) -> None:
    driver = Driver(program, address(bench))
    assert driver.line() == {"said": "connected"}
    driver.ask("send", type="cam", fields={"speed": 999, "spede": 1, **PLACE})
    driver.tell("confirmed")
    answer = driver.line()
    assert (answer["error"], answer["reason"]) == ("refused", "bad-json")
    assert {value for _, _, value in answer["invalid"]} == {999, 1}
    driver.close()


def test_received_message_comes_as_plain_json_and_as_octets(bench: Bench, program: Path) -> None:
    driver = Driver(program, address(bench))
    assert driver.line() == {"said": "connected"}
    denm = pdu("denm", station=7, **PLACE)
    driver.ask("listen", types=["denm"], form="pdu")
    octets = received(bench, driver, denm)
    assert (octets["type"], octets["station"], octets["interface"]) == ("denm", 7, "g5")
    assert bytes(octets["pdu"]) == denm  # type: ignore[call-overload]
    driver.ask("listen", types=["denm"])
    plain = received(bench, driver, denm)
    assert (plain["type"], plain["station"], plain["error"]) == ("denm", 7, "")
    assert driver.ask("get", path="eventPosition.latitude") == PLACE["latitude"]
    driver.close()


def test_listen_to_an_unknown_type_is_an_error_with_the_known_ones(bench: Bench, program: Path) -> None:
    driver = Driver(program, address(bench))
    assert driver.line() == {"said": "connected"}
    driver.ask("listen", types=["cam", ""], form="pdu")
    driver.tell("listen", types=["cam", "camm"])
    answer = driver.line()
    assert answer["error"] == "invalid"
    assert "'camm': unknown to the station" in answer["what"]
    assert '"denm","cam"' in answer["what"]
    driver.close()


def test_client_continues_after_a_restart_of_the_station(launch_shared: Launcher, program: Path) -> None:
    bench = launch_shared()
    driver = Driver(program, address(bench))
    assert driver.line() == {"said": "connected"}
    driver.ask("listen", form="pdu")
    assert received(bench, driver, pdu("cam", station=7))["station"] == 7
    bench.station.stop()
    bench.station.start()
    while received(bench, driver, pdu("cam", station=8))["station"] != 8:
        pass
    driver.ask("send", type="cam", fields=PLACE)
    assert driver.ask("confirmed")["sent"] == ["g5"]
    driver.close()
