"""captain swarm, for a second."""

import json
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from drivers.wire import frame
from firmware import cli
from firmware.commands.swarm import FIRST_STATION
from firmware.swarm import audience
from tests.firmware.commands.fake import STATUS, FakeStation
from tests.firmware.commands.test_replay import end_when_one_is_confirmed
from tests.firmware.commands.test_send import confirm, sent_by
from tests.said import tells


def test_frames_come_to_whom_they_are_sent(capsys):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ear:
        ear.bind(("127.0.0.1", 0))
        ear.settimeout(5)
        to = "{}:{}".format(*ear.getsockname())
        assert cli.main(["swarm", "20", "--rate", "10", "--duration", "0.5", "--udp", to, "--json"]) == 0
        told = json.loads(capsys.readouterr().out)
        assert (told["sent"], told["types"], told["unheard"]) == (100, {"cam": 100}, 0)
        heard = [frame.unwrap(ear.recv(2048)) for _ in range(100)]
    assert len({one.source for one in heard if isinstance(one, frame.Ethernet)}) == 20


def test_messages_come_to_a_stations_pull_which_confirms_each(capsys):
    with FakeStation(answer=sent_by("g5")) as station:
        command = ["swarm", "3", "--rate", "10", "--duration", "0.5", "--denm", "20", "--endpoint", *station.options]
        assert cli.main([*command, "--json"]) == 0
        told = json.loads(capsys.readouterr().out)
    assert told["types"]["cam"] == 15
    assert told["outcomes"] == {"sent": told["sent"]}
    assert len({frames[1][2:6] for frames in station.requests}) == 3
    wishes = [(frames[1][1], json.loads(frames[2])) for frames in station.requests]
    assert {one["btp_port"] for number, one in wishes if number == 2} == {2001}
    assert {one["area"]["distance_a"] for number, one in wishes if number == 1} == {500}


def test_what_a_station_confirms_makes_nothing_earlier(capsys):
    with FakeStation(answer=sent_by("g5")) as station:
        assert (
            cli.main(["swarm", "1", "--rate", "10", "--duration", "0.5", "--endpoint", *station.options, "--json"]) == 0
        )
    told = json.loads(capsys.readouterr().out)
    assert told["sent"] == 5
    assert told["seconds"] >= 0.4


def every_third_too_many(options: dict[str, object], number: int) -> list[dict[str, object]]:
    if number % 3:
        return sent_by("g5")(options, number)
    full = confirm(options, "dropped", interface="g5", reason="queue-full", meaning="its queue is full")
    return [confirm(options, "accepted", interfaces=["g5"]), full]


def test_swarm_whose_messages_a_station_did_not_send_fails_with_the_reason(capsys):
    with FakeStation(answer=every_third_too_many) as station:
        assert cli.main(["swarm", "3", "--rate", "10", "--duration", "0.5", "--endpoint", *station.options]) == 1
    said = capsys.readouterr().out
    assert "the station says: 5 dropped, 10 sent" in said
    assert tells(said, "not sent: 5: ", "g5: queue-full")


def test_sigterm_ends_it_with_its_summary(capsys, monkeypatch):
    end_when_one_is_confirmed(monkeypatch)
    with FakeStation(answer=sent_by("g5")) as station:
        assert cli.main(["swarm", "1", "--rate", "10", "--endpoint", *station.options]) == 0
    assert "the station says: 1 sent" in capsys.readouterr().out


def test_swarm_to_a_closed_port_fails(capsys):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as holder:
        holder.bind(("127.0.0.1", 0))
        to = "{}:{}".format(*holder.getsockname())
    assert cli.main(["swarm", "2", "--rate", "10", "--duration", "0.3", "--udp", to]) == 1
    assert tells(capsys.readouterr().out, "refused: ", "no program")


def around(station: FakeStation, ear: socket.socket, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """A swarm around a station that says that it hears there."""
    details = {"listen": "{}:{}".format(*ear.getsockname()), "framing": "ethernet"}
    monkeypatch.setitem(STATUS, "interfaces", {"g5": {"driver": "udp", "details": details}})
    return ["swarm", "2", "--rate", "10", "--duration", "0.3", *station.options]


@pytest.fixture
def ear() -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ear:
        ear.bind(("127.0.0.1", 0))
        ear.settimeout(5)
        yield ear


def test_swarm_goes_where_the_status_of_the_station_says_that_it_listens(ear, monkeypatch, capsys):
    cam = bytes.fromhex("0202") + FIRST_STATION.to_bytes(4) + bytes(35)
    with FakeStation(received=[(b"v2x.cam.", cam)]) as station:
        assert cli.main(around(station, ear, monkeypatch)) == 0
    assert isinstance(frame.unwrap(ear.recv(2048)), frame.Ethernet)
    assert tells(capsys.readouterr().out, "station fake ", " 127.0.0.1:", "users receive")


def test_swarm_that_no_user_receives_fails(ear, monkeypatch, capsys):
    monkeypatch.setattr(audience, "LATE_S", 0.05)
    another = bytes.fromhex("020200000539") + bytes(35)
    with FakeStation(received=[(b"v2x.cam.", another)]) as station:
        command = around(station, ear, monkeypatch)
        assert cli.main([*command, "--json"]) == 1
        assert json.loads(capsys.readouterr().out)["is_received"] is False
        assert cli.main(command) == 1
    said = capsys.readouterr()
    assert tells(said.out.splitlines()[-1], "; ", "users received none")
    assert tells(said.err, "captain: ", "no user", "\n", "`captain status`")


def test_a_swarm_without_a_station_says_what_to_start(block, capsys):
    assert cli.main(["swarm", "2", "--duration", "0.1", "--station", f":{block}"]) == 1
    assert "start one with `captain run`" in capsys.readouterr().err


def test_a_swarm_around_a_station_that_hears_no_datagrams_names_other_ways(capsys):
    with FakeStation() as station:
        assert cli.main(["swarm", "2", "--duration", "0.1", *station.options]) == 1
    assert "--udp HOST:PORT, --ethernet DEVICE or --endpoint" in capsys.readouterr().err


def test_frames_leave_by_a_network_device():
    script = 'ip link add a0 type veth peer name a1 && ip link set a0 up && ip link set a1 up && exec "$@"'
    swarm = [sys.executable, "-m", "firmware", "swarm", "3", "--rate", "10", "--duration", "0.3", "--denm", "20"]
    count = "grep a1: /proc/net/dev"
    done = subprocess.run(
        [
            "unshare",
            "--map-root-user",
            "--net",
            "sh",
            "-c",
            script,
            "sh",
            "sh",
            "-c",
            f"{' '.join(swarm)} --ethernet a0 --json && {count}",
        ],
        capture_output=True,
        cwd=Path(__file__).parents[3],
        check=False,
    )
    assert done.returncode == 0, done.stderr.decode()
    told, counters = done.stdout.splitlines()
    sent = json.loads(told)
    assert sent["types"]["cam"] == 9
    assert sent["types"]["denm"] > 0
    assert int(counters.split()[2]) >= sent["sent"]  # packets received


def test_a_device_that_goes_down_costs_the_frames_of_that_time_and_says_so():
    script = 'ip link add a0 type veth peer name a1 && ip link set a1 up && exec "$@"'
    swarm = [sys.executable, "-m", "firmware", "swarm", "2", "--rate", "10", "--duration", "0.3", "--ethernet", "a0"]
    done = subprocess.run(
        ["unshare", "--map-root-user", "--net", "sh", "-c", script, "sh", *swarm, "--json"],
        capture_output=True,
        cwd=Path(__file__).parents[3],
        check=False,
    )
    assert done.returncode == 1, done.stderr.decode()
    told = json.loads(done.stdout)
    assert told["why"] == {"Network is down": told["refused"]}
    assert told["refused"] == 6
