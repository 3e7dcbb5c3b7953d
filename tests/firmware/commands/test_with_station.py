"""The commands against stations of ours: the two of the demo, of which A has simulated neighbours."""

import json
from contextlib import ExitStack

import pytest

from firmware import cli
from firmware.commands import demo
from firmware.lab import ports
from tests.said import tells

CAM = "0202000011d700010203"


@pytest.fixture
def stations(block, monkeypatch):
    monkeypatch.setattr(demo, "FIRST_PORT", block)
    with ExitStack() as ending:
        yield demo._start(ending)


def at(station: demo.DemoStation) -> list[str]:
    return ["--station", f":{station.place.from_users}"]


def test_messages_that_are_sent_are_confirmed_and_counted_in_the_status(stations, capsys):
    assert cli.main(["send", *at(stations[0]), "--rate", "0", "--count", "50", CAM]) == 0
    assert tells(capsys.readouterr().out, "50 given", ": 50 sent")
    assert cli.main(["status", *at(stations[0]), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["station"] == "A"
    assert told["interfaces"]["g5"]["sent"]["cam"] == 50
    assert told["endpoint"]["accepted"] == 50


def test_both_ways_of_asking_give_the_same_status(stations, capsys):
    assert cli.main(["status", *at(stations[1])]) == 0
    by_socket = capsys.readouterr().out
    assert cli.main(["status", *at(stations[1]), "--control", "/nowhere"]) == 1
    assert "interface  driver  link" in by_socket


def test_a_short_pdu_is_refused_with_its_reason(stations, capsys):
    assert cli.main(["send", *at(stations[0]), "0202"]) == 1
    assert "refused: short-pdu" in capsys.readouterr().out


def test_an_interface_that_is_not_there_is_a_reason(stations, capsys):
    assert cli.main(["send", *at(stations[0]), CAM, "--interface", "nosuch"]) == 1
    assert "no-interface" in capsys.readouterr().out


def test_neighbours_are_heard(stations, capsys):
    assert cli.main(["listen", *at(stations[0]), "--json", "--type", "cam", "--count", "2"]) == 0
    found = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [one["message_id"] for one in found] == [2, 2]
    assert all(len(one["hex"]) == 2 * one["octets"] and one["source_mac"] for one in found)


def test_station_that_runs_is_named_by_the_doctor(stations, capsys):
    first = stations[0].place.from_users
    keys = ("from_users", "to_users", "pull", "report")
    options = [word for at, key in enumerate(keys) for word in ("--set", f"endpoint.{key}={first + at}")]
    assert cli.main(["doctor", "--json", *options]) == 0
    texts = {one["subject"]: one["text"] for one in json.loads(capsys.readouterr().out)}
    there = ports.running(first)
    assert there is not None
    assert texts["endpoint"].endswith(f"belong to {ports.holder(there)}")
    # The demo's station has udp as g5, the configuration that doctor checks has som301e of the simulated board.
    assert not any("running station" in text for subject, text in texts.items() if "interface" in subject)
    assert texts["slot v2x"].startswith("som301e: ")
