"""The doctor on a machine whose station is a service: it looks at that service, and takes what the service takes."""

import json
from pathlib import Path

import pytest

from board.runtime import echo
from firmware import cli, systemd
from firmware.commands import doctor, selftest
from firmware.doctor import checks
from firmware.doctor.finding import Finding, Level
from firmware.lab import ports
from tests.firmware.commands.fake import STATUS
from tests.said import tells

DEFAULTS = '[station]\nname = "captain"\n[endpoint]\naddress = "127.0.0.1"\n'
BOARD = 'name = "bare"\n'


class Box:
    """A unit whose owner has written a configuration, and what its journal says."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.said = ""
        (folder / "current").mkdir()
        (folder / "defaults.toml").write_text(DEFAULTS)
        (folder / "board.toml").write_text(BOARD)

    def owner(self, text: str) -> None:
        (self.folder / "current/captain.toml").write_text(text)

    def unit(self, **more: str) -> systemd.Unit:
        given = "--config ${C} --board ${B} --defaults " + f"{self.folder}/defaults.toml"
        return {
            "ActiveState": "active",
            "SubState": "running",
            "Result": "success",
            "NRestarts": "0",
            "ExecStart": f"{{ path=/c ; argv[]=/c run {given} ; ignore_errors=no ; }}",
            "Environment": f"C={self.folder}/current/captain.toml B={self.folder}/board.toml",
            "EnvironmentFiles": "/run/captain-image/environment (ignore_errors=yes)",
            "WorkingDirectory": f"!{self.folder}/current",
        } | more


@pytest.fixture
def box(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, standin: object) -> Box:
    made = Box(tmp_path)
    monkeypatch.setattr(echo, "try_out", lambda: "a child process answered")
    monkeypatch.setattr(systemd, "ask", made.unit)
    monkeypatch.setattr(systemd, "journal", lambda: made.said)
    return made


LOOP = {"ActiveState": "activating", "SubState": "auto-restart", "Result": "exit-code", "NRestarts": "7"}


def json_of(capsys: pytest.CaptureFixture[str], *words: str) -> list[dict[str, str]]:
    cli.main(["doctor", "--json", *words])
    found: list[dict[str, str]] = json.loads(capsys.readouterr().out)
    return found


def test_station_that_crashes_again_and_again_is_a_problem_with_its_last_words(box: Box):
    words = json.dumps({"MESSAGE": "captain: 192.0.2.7: cannot be listened on"})
    (found,) = doctor.service(box.unit(**LOOP), lambda: words)
    assert found.level is Level.PROBLEM
    assert tells(found.text, "captain.service ", "activating (auto-restart)", "exit-code", " 7 times")
    assert found.text.endswith(": 192.0.2.7: cannot be listened on")
    assert found.remedy == systemd.CORRECT_CARD


@pytest.mark.parametrize(
    ("more", "level"),
    [
        ({}, Level.OK),
        ({"NRestarts": "2"}, Level.WARNING),
        ({"ActiveState": "activating", "SubState": "start"}, Level.WARNING),
        ({"ActiveState": "failed", "SubState": "failed"}, Level.PROBLEM),
        ({"ActiveState": "inactive", "SubState": "dead"}, Level.PROBLEM),
    ],
)
def test_what_became_of_the_service_is_judged(box: Box, more: dict[str, str], level: Level):
    (found,) = doctor.service(box.unit(**more), lambda: "")
    assert found.level is level
    assert bool(found.remedy) == (level is not Level.OK)


def test_without_options_the_services_configuration_board_and_folder_are_looked_at(
    box: Box, block: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    numbers = "".join(f"{key} = {block + at}\n" for at, key in enumerate(("from_users", "to_users", "pull", "report")))
    broker = '[interfaces.cloud]\ndriver = "mqtt"\nurl = "mqtts://b.example"\nca = "mqtt/ca.pem"\n'
    box.owner(f"[endpoint]\n{numbers}{broker}")
    monkeypatch.setattr(systemd, "ask", lambda: box.unit(**LOOP))
    found = json_of(capsys)
    by_subject = {one["subject"]: one for one in found}
    assert by_subject["service"]["level"] == "problem"
    assert by_subject["board"]["text"] == "bare: no hardware"
    assert str(block) in by_subject["endpoint"]["text"]
    assert any("mqtt/ca.pem: No such file" in one["text"] for one in found)
    (box.folder / "current/mqtt").mkdir()
    (box.folder / "current/mqtt/ca.pem").write_text("")
    assert not any("No such file" in one["text"] for one in json_of(capsys))


def test_an_owners_mistake_is_a_problem(box: Box, capsys: pytest.CaptureFixture[str]):
    box.owner("[endpoint]\npull = 70000\n")
    wrong = [one for one in json_of(capsys) if one["level"] == "problem"]
    assert [one["subject"] for one in wrong] == ["configuration"]
    assert "current/captain.toml: endpoint.pull: 70000" in wrong[0]["text"]


def test_with_options_the_service_is_nobodys_question(box: Box, capsys: pytest.CaptureFixture[str]):
    box.owner("[endpoint]\npull = 70000\n")
    found = json_of(capsys, "--board", "none")
    assert "service" not in {one["subject"] for one in found}


def test_ports_of_the_running_service_are_its_own_and_no_warning(
    box: Box, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    box.owner("")
    monkeypatch.setattr(ports, "running", lambda *_: STATUS)
    monkeypatch.setattr(ports, "is_free", lambda host, port: False)
    (endpoint,) = [one for one in json_of(capsys) if one["subject"] == "endpoint"]
    assert (endpoint["level"], endpoint["remedy"]) == ("ok", "")
    assert "running station" in endpoint["text"]


def test_what_only_the_services_user_may_do_is_no_problem(box: Box, monkeypatch: pytest.MonkeyPatch):
    def refuse(*_: object) -> None:
        raise checks.StationError("raw sockets are not permitted", "run as root") from PermissionError(1)

    monkeypatch.setattr(checks.Trial, "run", refuse)
    read = doctor.captain_toml.load(None, ["interfaces.air.driver=ethernet", "interfaces.air.device=lo"], "none")
    (found,) = checks.interface(read.interfaces[0], read.mac, None, is_service=True)
    assert found.level is Level.OK
    (found,) = checks.interface(read.interfaces[0], read.mac, None)
    assert (found.level, found.remedy) == (Level.PROBLEM, "run as root")


def test_file_that_only_the_user_of_the_service_may_read_is_no_problem(
    box: Box, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    box.owner('[interfaces.cloud]\ndriver = "mqtt"\nurl = "mqtts://b.example"\nca = "ca.pem"\n')
    (box.folder / "current/ca.pem").touch()
    monkeypatch.setattr(doctor.mqtt.os, "access", lambda path, way, **more: path != "ca.pem")
    told = [Finding(**{**one, "level": Level(one["level"])}) for one in json_of(capsys)]
    of_cloud = [one for one in told if one.subject == "interface cloud" and "ca.pem" in one.text]
    assert [(one.level, tells(one.text, "only the service", "read")) for one in of_cloud] == [(Level.OK, True)]


def test_the_selftest_of_a_service_is_of_its_board(
    box: Box, block: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    box.owner(f"[endpoint]\nfrom_users = {block}\n")
    assert cli.main(["selftest"]) == 1
    assert "nothing is declared" in capsys.readouterr().out
    assert selftest.table([]).title == "nothing is declared"
