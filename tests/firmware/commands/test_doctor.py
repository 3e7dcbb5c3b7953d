import json
import socket
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from board.runtime import echo
from firmware import cli
from firmware.commands import doctor
from firmware.config import captain_toml
from firmware.doctor.finding import Finding, Level
from tests.firmware.commands.fake import STATUS, FakeControl
from tests.said import tells


@pytest.fixture(autouse=True)
def calm(tmp_path, monkeypatch, standin):
    """No station of this machine is asked, a child process answers at once, and there is a message library."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    monkeypatch.setattr(echo, "try_out", lambda: "a child process answered")


def options(block: int) -> list[str]:
    keys = ("from_users", "to_users", "pull", "report")
    return [word for at, key in enumerate(keys) for word in ("--set", f"endpoint.{key}={block + at}")]


def test_a_machine_that_has_everything_has_no_problem(block, capsys):
    air = ["--board", "none", "--set", "interfaces.g5.driver=udp", "--set", "interfaces.g5.listen=127.0.0.1:0"]
    assert cli.main(["doctor", *air, *options(block)]) == 0
    said = capsys.readouterr().out
    assert "problem  " not in said
    assert "interface g5: udp: " in said
    assert said.endswith("problems: 0, warnings: 0\n")


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ([], ("delivered", "unverifiable-pkt")),
        (["--set", "reception.unverified=drop"], ("dropped",)),
    ],
)
def test_unverified_signatures_are_reported_once_with_the_policy(block, capsys, given, told):
    assert cli.main(["doctor", "--json", "--board", "none", *given, *options(block)]) == 0
    (found,) = (one for one in json.loads(capsys.readouterr().out) if one["subject"] == "security")
    assert (found["level"], found["remedy"]) == ("ok", "")
    assert tells(found["text"], "not verified", *told, "(reception.unverified)")


def test_json_is_a_list_of_findings(block, capsys):
    assert cli.main(["doctor", "--json", "--board", "none", *options(block)]) == 0
    found = json.loads(capsys.readouterr().out)
    assert {"level", "subject", "text", "remedy"} == set(found[0])
    (warning,) = (one["text"] for one in found if one["level"] == "warning")
    assert "no interface" in warning


def test_file_of_registered_message_types_is_named(block, tmp_path, monkeypatch, capsys):
    path = tmp_path / "types.toml"
    path.write_text('[[types]]\nnumber = 200\nname = "hello"\n')
    monkeypatch.setenv("CAPTAIN_TYPES", str(path))
    assert cli.main(["doctor", "--json", "--board", "none", *options(block)]) == 0
    found = [one["text"] for one in json.loads(capsys.readouterr().out) if one["subject"] == "configuration"]
    assert any(tells(text, "message types", str(path)) for text in found)


def test_each_mistake_of_the_configuration_is_a_problem(tmp_path, capsys):
    path = tmp_path / "captain.toml"
    path.write_text('[station]\nnam = "a"\n[endpoint]\npull = 70000\n')
    assert cli.main(["doctor", "--config", str(path)]) == 1
    said = " ".join(capsys.readouterr().out.split())
    assert said.count("problem configuration:") == 2
    assert "station.nam" in said
    assert "endpoint.pull" in said


def test_a_configuration_that_is_not_there_is_a_problem(tmp_path, capsys):
    assert cli.main(["doctor", "--config", str(tmp_path / "none.toml")]) == 1
    assert "none.toml" in "".join(capsys.readouterr().out.split())


def test_station_that_runs_is_found_by_its_control_socket(block, tmp_path, capsys):
    answer = json.dumps({"ok": True, "status": STATUS}).encode() + b"\n"
    with FakeControl(tmp_path / f"captain-{block}.sock", answer), socket.create_server(("127.0.0.1", block)):
        assert cli.main(["doctor", "--json", *options(block)]) == 0
    texts = {one["subject"]: one["text"] for one in json.loads(capsys.readouterr().out)}
    assert "station 'fake', pid 4711" in texts["endpoint"]
    assert "running station" in texts["interface g5"]


def interfaces_beside(station: dict[str, object], block: int, folder: Path, capsys, *more: str) -> dict[str, dict]:
    """Return doctor's findings on interfaces, by subject, while a station with this status runs on the ports."""
    answer = json.dumps({"ok": True, "status": station}).encode() + b"\n"
    with FakeControl(folder / f"captain-{block}.sock", answer), socket.create_server(("127.0.0.1", block)):
        cli.main(["doctor", "--json", "--board", "none", *more, *options(block)])
    found = json.loads(capsys.readouterr().out)
    return {one["subject"]: one for one in found if one["subject"].startswith("interface")}


def test_an_interface_that_the_running_station_configures_differently_is_tried(block, tmp_path, capsys):
    other = ["--set", "interfaces.g5.driver=ethernet", "--set", "interfaces.g5.device=absent0"]
    found = interfaces_beside(STATUS | {"configuration": "00"}, block, tmp_path, capsys, *other)
    assert found["interface g5"]["level"] == "problem"
    assert "absent0" in found["interface g5"]["text"]


def test_interface_of_a_station_with_the_same_configuration_is_asked_and_not_tried(block, tmp_path, capsys):
    udp = ["--set", "interfaces.g5.driver=udp", "--set", "interfaces.g5.listen=192.0.2.1:1"]
    overrides = [word for word in (*udp, *options(block)) if word != "--set"]
    same = captain_toml.load(None, overrides, "none").digest
    found = interfaces_beside(STATUS | {"configuration": same}, block, tmp_path, capsys, *udp)
    assert found["interface g5"]["level"] == "ok"
    assert "running station" in found["interface g5"]["text"]


@given(st.builds(Finding, st.sampled_from(Level), st.text(), st.text(), st.text()), st.integers(40, 120))
def test_a_finding_fits_the_screen_and_obeys_nobody(finding, width):
    lines = doctor.lines(finding, width)
    assert all(len(line) <= width and line.isprintable() for line in lines)
    assert lines[0].startswith(finding.level.value)


def test_several_mistakes_of_a_file_are_as_many_lines():
    finding = Finding(Level.PROBLEM, "interface v2n", "a.toml: foo\na.toml: bar\x1b[2J", "mend both")
    assert doctor.lines(finding, 80) == [
        "problem  interface v2n: a.toml: foo",
        "         a.toml: bar\\x1b[2J",
        "         -> mend both",
    ]
