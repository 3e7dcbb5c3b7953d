"""Screens of the commands that show one state and end: help, wrong usage, status, board, time, modules, self-test."""

import json
from pathlib import Path
from types import SimpleNamespace

import pytest

from firmware import cli
from firmware.client.show.table import Screen
from firmware.commands import doctor, lab, status
from firmware.doctor.finding import Finding, Level
from tests.firmware.commands.fake import STATUS, FakeControl
from tests.firmware.commands.test_board import BOARD, FAULT, POSITION, ROWS, SLOT
from tests.firmware.commands.test_gnss import RECEIVER
from tests.firmware.commands.test_modem import MODEM
from tests.firmware.commands.test_time import CLOCK, history
from tests.screens.terminal import SCREENS, Terminal, compare

NOW = 1795182430.0
STARTING = {"state": "starting", "why": "identifying the receiver at USB place 1-1.1", "since_s": 0.4, "restarts": 0}
QUEUE = {"length": 0, "capacity": 256, "longest": 0}
FULL_STATUS: dict[str, object] = STATUS | {
    "interfaces": {
        **STATUS["interfaces"],  # type: ignore[dict-item]
        "gnss": {"driver": "zed_f9p", "technology": "gnss", "received": {}, "sent": {}, "queue": QUEUE, **STARTING},
    }
}


@pytest.mark.parametrize("verb", cli.VERBS)
def test_every_command_has_a_screen(verb: str) -> None:
    assert any(path.stem == verb or path.stem.startswith(f"{verb}-") for path in SCREENS.iterdir())


@pytest.mark.parametrize(
    ("name", "argv"),
    [
        ("help", ["--help"]),
        ("unknown-command", ["lisen"]),
        ("unknown-command-without-a-near-one", ["xyzzy"]),
        ("wrong-option", ["listen", "--tpye", "cam"]),
        ("wrong-value", ["slot", "cycel", "1"]),
    ],
)
def test_help_and_wrong_usage_fit_a_screen(name: str, argv: list[str], terminal: Terminal) -> None:
    terminal.run(*argv)
    compare(name, terminal.lines())


@pytest.mark.parametrize(
    ("name", "answer", "argv"),
    [
        ("slot", {"slots": {"cellular": SLOT, "gnss": FAULT}}, ["slot", "list"]),
        (
            "board",
            {"board": BOARD, "timeline": [{"at_s": 0.1, "who": "gnss", "what": "starting: identifying"}]},
            ["board", "show"],
        ),
        ("selftest", {"rows": ROWS}, ["selftest"]),
        ("gnss", {"status": STATUS | {"interfaces": {"gnss": RECEIVER}}}, ["gnss", "status"]),
        ("modem", {"status": STATUS | {"interfaces": {"cellular": MODEM}}}, ["modem", "status"]),
    ],
)
def test_the_answer_of_a_station_fits_a_screen(
    name: str, answer: dict[str, object], argv: list[str], terminal: Terminal, tmp_path: Path
) -> None:
    with FakeControl(tmp_path / "control", json.dumps({"ok": True, **answer}).encode() + b"\n") as station:
        terminal.run(*argv, "--control", str(station.path))
    compare(name, terminal.lines())


def test_the_time_of_a_station_fits_a_screen(terminal: Terminal, tmp_path: Path) -> None:
    answer = {"ok": True, "clock": CLOCK, "history": history().told()}
    with FakeControl(tmp_path / "control", json.dumps(answer).encode() + b"\n") as station:
        terminal.run("time", "--control", str(station.path))
    compare("time", terminal.lines()[-24:])


@pytest.mark.parametrize(
    ("name", "told"), [("status", FULL_STATUS), ("status-board", STATUS | {"board": BOARD, "position": POSITION})]
)
def test_the_first_screen_of_a_status_has_whole_headings(
    name: str, told: dict[str, object], terminal: Terminal
) -> None:
    with Screen(terminal, "captain status | less") as screen:
        screen.show(status.tables(told, NOW))
    compare(name, terminal.lines())


def test_findings_of_the_doctor_fit_a_screen(terminal: Terminal) -> None:
    findings = [
        Finding(Level.OK, "interface g5", "udp: listens at 127.0.0.1:8947"),
        Finding(Level.WARNING, "interface gnss", "zed_f9p: starting in the running station: identifying the receiver"),
        Finding(
            Level.PROBLEM, "ports", "5555 is in use by another program" + " that is not a station" * 4, "choose others"
        ),
    ]
    for finding in findings:
        print("\n".join(doctor.lines(finding, 80)), file=terminal)
    compare("doctor", terminal.lines())


def test_the_table_of_the_lab_has_whole_headings(terminal: Terminal) -> None:
    row = SimpleNamespace(
        vector=SimpleNamespace(name="spatem of 203 octets"),
        sender="A",
        sent=600,
        received=600,
        equal=600,
        altered=0,
        lost=0,
    )
    with Screen(terminal) as screen:
        screen.show([lab.table(SimpleNamespace(rows=lambda: [row, row], strange=1))])  # type: ignore[arg-type]
    compare("lab", terminal.lines())
