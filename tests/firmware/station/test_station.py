"""A whole station on a loop: what it opens, what it closes, and what a reload changes."""

import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import pytest
import zmq

from board.runtime.errors import ConfigurationError, InterfaceError
from board.runtime.loop import Loop
from drivers.message import NO_RX_INFO, Indication, Position
from firmware.config import captain_toml
from firmware.config.reload import READ_S
from firmware.station.station import RELOAD_S, Station
from tests.firmware.doubles import CAM_PDU
from tests.said import tells

ROOT = Path(__file__).parents[3]


class Folder:
    def __init__(self, path: Path) -> None:
        self.path = path
        self.write("")

    def write(self, text: str) -> None:
        (self.path / "captain.toml").write_text(
            f"[endpoint]\ncontrol = '{self.path}/control'\nfrom_users = 0\nto_users = 0\npull = 0\nreport = 0\n"
            "[interfaces.air]\ndriver = 'udp'\nframing = 'pdu'\nlisten = '127.0.0.1:0'\n"
            f"{text}\n"
        )

    def load(self, *overrides: str) -> captain_toml.Config:
        return self.source(*overrides).load()

    def station(self, loop: Loop, *overrides: str) -> Station:
        return Station(loop, self.load(*overrides), self.source(*overrides))

    def source(self, *overrides: str) -> captain_toml.ConfigSource:
        return captain_toml.ConfigSource(str(self.path / "captain.toml"), overrides, "none")


@pytest.fixture
def folder(tmp_path: Path) -> Folder:
    return Folder(tmp_path)


@pytest.fixture
def loop() -> Iterator[Loop]:
    with closing(Loop()) as loop:
        yield loop


def test_a_station_that_was_never_started_closes(folder: Folder, loop: Loop) -> None:
    folder.station(loop).close()
    assert loop._sources == {}


def test_a_station_that_fails_without_being_stopped_closes(folder: Folder, loop: Loop) -> None:
    station = folder.station(loop)
    station.start()
    station.close()
    assert loop._sources == {}
    assert not (folder.path / "control").exists()


def test_a_station_that_is_stopped_ends_its_loop_and_closes(folder: Folder, loop: Loop) -> None:
    station = folder.station(loop)
    station.start()
    loop.soon(station.stop)
    loop.soon(station.stop)
    loop.run()
    station.close()
    assert loop._sources == {}


def port_of(station: Station) -> int:
    import zmq

    return int(station.endpoint.inlets[0]._socket.get(zmq.LAST_ENDPOINT).rstrip(b"\0").decode().rpartition(":")[2])


def test_who_asks_for_it_is_told_of_messages_at_once_and_a_subscription_to_everything_asks_for_nothing(
    folder: Folder, loop: Loop
) -> None:
    with closing(folder.station(loop)) as station, zmq.Context() as context, context.socket(zmq.SUB) as subscriber:
        station.start()
        report = station.endpoint.report
        subscriber.connect(station.endpoint._reports._socket.get(zmq.LAST_ENDPOINT).rstrip(b"\0").decode())
        subscriber.subscribe(b"")
        _turn_until(loop, lambda: station.router.is_confirm_wanted)
        assert not report.is_hurried
        subscriber.subscribe(b"soon.")
        _turn_until(loop, lambda: report.is_hurried)
        subscriber.unsubscribe(b"soon.")
        _turn_until(loop, lambda: not report.is_hurried)


def test_what_came_a_moment_before_the_end_is_told(folder: Folder, loop: Loop) -> None:
    with zmq.Context() as context, context.socket(zmq.SUB) as subscriber:
        station = folder.station(loop)
        with closing(station):
            station.start()
            subscriber.connect(station.endpoint._reports._socket.get(zmq.LAST_ENDPOINT).rstrip(b"\0").decode())
            subscriber.rcvtimeo = 5000
            for topic in (b"frame.", b"indication."):
                subscriber.subscribe(topic)
            _turn_until(loop, lambda: {b"frame.", b"indication."} <= station.endpoint._wanted)
            station.router.indicate(Indication(station.topics.by_number[2], CAM_PDU, "air", 1, 1.0, NO_RX_INFO))
            station.router.flush()
        assert {subscriber.recv_multipart()[0] for _ in range(2)} == {b"indication.cam.", b"frame.air."}


def _turn_until(loop: Loop, holds: Callable[[], bool]) -> None:
    """Fails after five seconds."""
    is_late = False

    def end() -> None:
        nonlocal is_late
        is_late = True

    timer = loop.after(5.0, end)
    while not holds():
        assert not is_late, "it never came to hold"
        loop.turn()
    timer.cancel()


@pytest.mark.parametrize("key", ["from_users", "to_users", "pull", "report"])
def test_a_port_that_is_taken_is_named_with_its_option_and_nothing_stays_open(
    folder: Folder, loop: Loop, key: str
) -> None:
    with closing(folder.station(loop)) as first:
        with pytest.raises(InterfaceError) as caught:
            folder.station(loop, f"endpoint.{key}={port_of(first)}")
        assert caught.value.message.startswith(f"endpoint.{key}: cannot bind tcp://127.0.0.1:{port_of(first)}: ")


def test_a_control_path_that_is_taken_is_named_and_nothing_stays_open(folder: Folder, loop: Loop) -> None:
    with closing(folder.station(loop)):
        with pytest.raises(InterfaceError, match=r"endpoint\.control: cannot listen"):
            folder.station(loop)
        assert (folder.path / "control").is_socket()


def test_an_interface_that_cannot_start_is_waited_for_and_the_station_runs(folder: Folder, loop: Loop) -> None:
    # 192.0.2.0/24 is for documentation (RFC 5737): nobody here has such an address
    with closing(folder.station(loop, "interfaces.air.listen=192.0.2.1:8947")) as station:
        station.start()
        assert station.status()["interfaces"]["air"]["state"] == "waiting"


def test_the_status_is_json_and_has_what_is_promised(folder: Folder, loop: Loop) -> None:
    with closing(folder.station(loop)) as station:
        station.start()
        status = json.loads(json.dumps(station.status()))
        assert status["station"] == "captain"
        assert status["interfaces"]["air"]["state"] == "up"
        assert status["endpoint"]["requests"] == 0
        assert status["drops"] == []
        assert status["policy"] == [{"name": "default", "matched": 0}]
        assert status["duplicates"]["window_s"] == 2.0
        assert status["memory_kb"] > 0


def test_the_legacy_profile_suppresses_no_duplicates_and_adds_no_localinfo(folder: Folder, loop: Loop) -> None:
    with closing(folder.station(loop, "station.profile=legacy")) as station:
        assert station.router.stages == ()
        assert station.endpoint.users._local is None


def names(station: Station) -> list[str]:
    return [row["name"] for row in station.router.policy.status()]


def reload(station: Station) -> object:
    """What the station answers: the number of rows, or an error."""
    answers: list[object] = []
    station.reload(answers.append)
    while not answers:
        station.loop.turn()
    return answers[0]


def test_a_reload_takes_the_policy_of_the_file(folder: Folder, loop: Loop) -> None:
    with closing(folder.station(loop)) as station:
        folder.write("[[policy]]\nname = 'new'")
        reload(station)
        assert names(station) == ["new", "default"]


def test_a_reload_is_answered_by_the_control_socket_after_two_slow_readings(folder: Folder, loop: Loop) -> None:
    with closing(folder.station(loop)) as station:
        assert station._commands().within_s["reload"] == RELOAD_S > 2 * READ_S


def test_a_file_with_a_mistake_leaves_the_policy_as_it_was(folder: Folder, loop: Loop) -> None:
    folder.write("[[policy]]\nname = 'old'")
    with closing(folder.station(loop)) as station:
        folder.write("[[policy]]\nname = 'new'\npriority = 99")
        assert isinstance(reload(station), ConfigurationError)
        assert names(station) == ["old", "default"]


def test_a_file_that_is_gone_leaves_the_policy_as_it_was(folder: Folder, loop: Loop) -> None:
    folder.write("[[policy]]\nname = 'old'")
    with closing(folder.station(loop)) as station:
        (folder.path / "captain.toml").unlink()
        reload(station)
        assert names(station) == ["old", "default"]


def test_reload_of_another_table_than_policy_is_logged_as_not_applied(
    folder: Folder, loop: Loop, caplog: pytest.LogCaptureFixture
) -> None:
    with closing(folder.station(loop)) as station:
        folder.write("[station]\nname = 'other'\n[[policy]]\nname = 'new'")
        reload(station)
        assert tells(caplog.text, "[station]: ", "not applied", "restart")
        assert station.status()["station"] == "captain"
        assert names(station) == ["new", "default"]


def test_clock_that_is_not_set_makes_the_position_unknown_and_is_logged(
    folder: Folder, loop: Loop, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("firmware.station.station.time.time", lambda: 12.0)
    station = folder.station(loop, "station.position={latitude=48.0, longitude=11.0}")
    station.start()
    assert (station.own_position.ego().its_ms, station.own_position.ego().is_known) == (0, False)
    assert station.status()["is_clock_set"] is False
    assert tells(caplog.text, "clock: ", "not set", "own position", "unknown")
    station.close()


def test_a_station_may_be_bound_to_an_ipv6_address(folder: Folder, loop: Loop) -> None:
    station = folder.station(loop, "endpoint.address='::1'")
    address = station.endpoint.users.publisher._socket.get(zmq.LAST_ENDPOINT)
    assert address.startswith(b"tcp://[::1]:")
    station.close()


def test_a_reload_keeps_the_counts_of_rows_that_stay(folder: Folder, loop: Loop) -> None:
    folder.write('[[policy]]\nname = "cams"\nmatch.type = ["cam"]')
    station = folder.station(loop)
    station.router.request(station.topics.by_number[2], b"\2\2\0\0\0\1", "pull")
    reload(station)
    assert station.router.policy.status()[0] == {"name": "cams", "matched": 1}
    station.close()


def test_reload_with_another_board_file_is_logged_as_not_applied(
    folder: Folder, loop: Loop, caplog: pytest.LogCaptureFixture
) -> None:
    board = folder.path / "mine.toml"
    board.write_text("name = 'mine'\n")

    source = captain_toml.ConfigSource(str(folder.path / "captain.toml"), (), str(board))
    with closing(Station(loop, source.load(), source)) as station:
        board.write_text("name = 'mine'\n[slots.v2x]\nusb = '1-1.3'\n")
        reload(station)
        assert tells(caplog.text, "board file: ", "not applied", "restart")


STATIC = "[interfaces.place]\ndriver = 'zed_f9p'\nkind = 'static'\nlatitude = 48.5\nlongitude = 11.25\n"


def test_a_receiver_gives_the_station_its_position(folder: Folder, loop: Loop) -> None:
    folder.write(f"[station]\nposition = {{ latitude = 1.0, longitude = 2.0 }}\n{STATIC}")
    with closing(folder.station(loop)) as station:
        station.start()
        assert station.own_position.ego().position == Position(10_000_000, 20_000_000)
        loop.turn()
        assert station.own_position.ego().position == Position(485_000_000, 112_500_000)
        assert station.router.ego() == station.own_position.ego()
        status = json.loads(json.dumps(station.status()))
        assert (status["position"]["source"], status["position"]["latitude"]) == ("place", 48.5)


def test_a_station_without_hardware_has_no_board_and_imports_nothing_for_it(folder: Folder, loop: Loop) -> None:
    with closing(folder.station(loop)) as station:
        station.start()
        assert "board" not in station.status()
    code = "import sys, firmware.station.station; print('firmware.station.carrier' in sys.modules, 'board.usb' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert done.stdout.split() == ["False", "False"]


def test_links_that_come_up_are_in_the_time_line_of_the_start(folder: Folder, loop: Loop) -> None:
    with closing(folder.station(loop)) as station:
        station.start()
        (note,) = station.timeline.status()
        assert (note["who"], note["what"][:4]) == ("air", "up: ")


SECOND = "[interfaces.other]\ndriver = 'udp'\nframing = 'pdu'\n{option}\n"


@pytest.mark.parametrize(
    ("text", "is_paired"),
    [
        ("", False),
        (SECOND.format(option="peers = ['127.0.0.1:1']"), False),
        (SECOND.format(option="listen = '127.0.0.1:0'"), True),
    ],
)
def test_copies_are_looked_for_where_more_than_one_interface_receives(
    folder: Folder, loop: Loop, text: str, is_paired: bool
) -> None:
    folder.write(text)
    with closing(folder.station(loop)) as station:
        assert station.router.stages == ((station.duplicates,) if is_paired else ())


def test_a_driver_with_a_last_word_is_waited_for_when_all_are_stopped(
    folder: Folder, loop: Loop, monkeypatch: pytest.MonkeyPatch
) -> None:
    station = folder.station(loop)
    driver = station.router.interfaces["air"].driver
    said: list[str] = []
    stop = driver.stop
    monkeypatch.setattr(driver, "stop", lambda: (said.append("stop"), stop()))
    monkeypatch.setattr(driver, "part", lambda: said.append("part"), raising=False)
    station.start()
    station.close()
    assert (said[-1], said.count("part")) == ("part", 1)
