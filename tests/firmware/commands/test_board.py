"""captain slot, board and selftest, against control sockets that say what a test wants them to say."""

import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from firmware import cli
from firmware.client.show.status import board
from firmware.client.show.table import plain
from firmware.commands import board as board_command
from firmware.commands import selftest, slot, status
from tests.firmware.commands.fake import STATUS, FakeControl
from tests.said import tells

SLOT: dict[str, object] = {
    "number": 4,
    "title": "SIMCom SIM8202G-M2",
    "usb": "1-1.4",
    "device": "1e0e:9001",
    "note": "",
    "interface": "cellular",
    "state": "running",
    "since_s": 12.5,
    "why": "driver started",
    "cause": "",
    "cycles": 2,
}
FAULT = SLOT | {
    "number": 1,
    "state": "fault",
    "why": "no USB device at 1-1.1 within 10 s; given up after 3 power cycles",
}
BOARD: dict[str, object] = {
    "name": "sim",
    "description": "simulated",
    "identity": {"vendor": "captain", "product": "Quad Expander", "product_ver": "0x0001"},
    "slots": {"cellular": SLOT, "gnss": FAULT},
    "rails": {"main": {"v": 8.2, "a": 1.25, "w": 10.25, "age_s": 2.0, "crossed": ["v below 9 V"], "fault": None}},
    "temperatures": {"board": {"age_s": None, "crossed": [], "fault": "no answer from 0x48 on /dev/i2c-1"}},
    "fan": {"rpm": 2640, "percent": 50.2, "age_s": 2.0, "crossed": [], "fault": None},
    "complaints": ["rail main: 8.2 V is below 9 V", "temperature board: no answer from 0x48 on /dev/i2c-1"],
    "worker": {"is_up": True},
}
POSITION = {
    "latitude": 48.7668616,
    "longitude": 11.432068,
    "source": "gnss",
    "fix": "full",
    "carrier": "fixed",
    "age_s": 0.2,
    "horizontal_m": 0.014,
    "speed_m_s": 13.9,
    "time_mark": {"accuracy_ns": 25, "is_locked": True},
}
ROWS = [
    {"capability": "rail main", "is_present": True, "works": True, "value": "12 V", "remedy": "", "ask": ""},
    {"capability": "fan", "is_present": False, "works": False, "value": "none", "remedy": "plug it in", "ask": ""},
]

anything = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=8,
)


def control(folder: Path, **answer: object) -> FakeControl:
    return FakeControl(folder / "control", json.dumps({"ok": True, **answer}).encode() + b"\n")


def test_the_slots_are_a_table_with_what_is_wrong_below(tmp_path, capsys):
    with control(tmp_path, slots={"cellular": SLOT, "gnss": FAULT}) as station:
        assert cli.main(["slot", "list", "--control", str(station.path)]) == 0
    said = capsys.readouterr().out.splitlines()
    assert said[1].split() == ["slot", "name", "state", "for", "interface", "cycles", "device"]
    assert said[2].split() == [
        "4",
        "cellular",
        "running",
        "12",
        "s",
        "cellular",
        "2",
        "1e0e:9001",
        "SIMCom",
        "SIM8202G-M2",
    ]
    assert "  gnss: no USB device at 1-1.1 within 10 s; given up after 3 power cycles" in said
    assert max(map(len, said)) <= 80


def test_a_slot_is_asked_for_by_its_name(tmp_path, capsys):
    with control(tmp_path, slots={"gnss": FAULT}) as station:
        assert cli.main(["slot", "cycle", "gnss", "--json", "--control", str(station.path)]) == 0
    (line,) = station.lines
    question = json.loads(line)
    assert (question["do"], question["ask"], question["slot"]) == ("slot", "cycle", "gnss")
    assert json.loads(capsys.readouterr().out) == {"gnss": FAULT}


@pytest.mark.parametrize(
    ("one", "code"), [(SLOT, 0), (FAULT, 1), (SLOT | {"state": "off"}, 0), (SLOT | {"state": "empty"}, 1)]
)
def test_who_waits_is_told_by_the_exit_code_how_it_ended(tmp_path, one, code):
    with control(tmp_path, slots={"gnss": one}) as station:
        assert cli.main(["slot", "cycle", "gnss", "--wait", "--control", str(station.path)]) == code
    assert len(station.lines) == 2


def test_who_waits_is_told_each_change_on_stderr_and_the_end_on_stdout(monkeypatch, capsys):
    walk = ["cycling", "powering", "powering", "starting", "running"]
    answers = iter([{"gnss": SLOT | {"state": state, "why": f"why {state}"}} for state in walk])
    monkeypatch.setattr(slot, "_ask", lambda *_: next(answers))
    monkeypatch.setattr(slot, "LOOK_S", 0.0)
    assert cli.main(["slot", "cycle", "gnss", "--wait", "--json"]) == 0
    told = capsys.readouterr()
    assert told.err == "slot gnss: powering: why powering\nslot gnss: starting: why starting\n"
    assert json.loads(told.out)["gnss"]["state"] == "running"


@pytest.mark.parametrize("words", [["list", "gnss"], ["on"], ["cycle"]])
def test_a_slot_is_named_where_one_is_meant_and_only_there(capsys, words):
    assert cli.main(["slot", *words]) == 2
    assert "name" in capsys.readouterr().err


def test_refusal_of_the_station_is_shown_with_its_hint(tmp_path, capsys):
    answer = b'{"ok": false, "error": "no slots", "hint": "declare some"}\n'
    with FakeControl(tmp_path / "control", answer) as station:
        assert cli.main(["slot", "list", "--control", str(station.path)]) == 1
    assert "no slots\n  (declare some)" in capsys.readouterr().err


def test_only_a_station_of_this_machine_is_asked_for_its_board(capsys):
    assert cli.main(["board", "show", "--station", "192.0.2.1"]) == 1
    assert "192.0.2.1 is another machine" in capsys.readouterr().err


def test_without_a_station_what_to_do_is_told(capsys):
    assert cli.main(["board", "show", "--station", ":5999"]) == 1
    assert "start one with `captain run`" in capsys.readouterr().err


def test_board_is_shown_with_its_measurements_and_the_time_line(tmp_path, capsys):
    line = [{"at_s": 0.06, "who": "slot gnss", "what": "powering: started"}]
    with control(tmp_path, board=BOARD, timeline=line) as station:
        assert cli.main(["board", "show", "--control", str(station.path)]) == 0
    said = capsys.readouterr().out
    assert "board sim: captain Quad Expander 0x0001" in said
    assert "rail         main   8.2 V 1.25 A 10.25 W    2.0" in said
    assert "temperature  board  none                    0.0" in said
    assert "no answer from 0x48 on /dev/i2c-1" in said
    assert "rail main: 8.2 V is below 9 V" in said
    assert "0.06  slot gnss  powering: started" in said
    assert max(map(len, said.splitlines())) <= 80


@pytest.mark.parametrize("count", [0, 1, 5, 60])
@pytest.mark.parametrize("height", [23, 12, 1])
def test_on_a_terminal_the_time_line_is_as_long_as_fits_and_ends_with_its_end(count, height):
    line = [{"at_s": at, "who": "slot gnss", "what": f"step {at}"} for at in range(count)]
    whole = list(board_command.tables({"board": BOARD, "timeline": line}))
    fitted = board_command.fitting(whole, 80, height)
    *above, shown = ([*plain(table, 80), ""] for table in fitted)
    least = sum(map(len, above)) + len(plain(fitted[-1]._replace(rows=()), 80)) + 1
    assert sum(map(len, above)) + len(shown) <= max(height, least)
    assert fitted[:-1] == whole[:-1]
    if fitted != whole:
        assert f"of {count}; `captain board show | less` has all" in shown[-2]
        assert list(fitted[-1].rows) == list(whole[-1].rows)[count - len(fitted[-1].rows) :]


def test_in_a_pipe_no_value_is_cut(tmp_path, capsys):
    what = "powering: the station has started; waits for 1e0e:9001 or 1e0e:9011 or 1e0e:901e at 1-1.4"
    line = [{"at_s": 0.06, "who": "slot cellular", "what": what}] * 50
    with control(tmp_path, board=BOARD, timeline=line) as station:
        assert cli.main(["board", "show", "--control", str(station.path)]) == 0
    assert capsys.readouterr().out.count(f"  {what}\n") == 50


def test_board_without_hardware_is_shown_as_such(tmp_path, capsys):
    with control(tmp_path, board=None, timeline=[]) as station:
        assert cli.main(["board", "show", "--control", str(station.path)]) == 0
    assert tells(capsys.readouterr().out, "board file", "no hardware")


def test_the_status_has_slots_measurements_and_the_position_in_80_columns():
    told = STATUS | {"board": BOARD, "position": POSITION}
    lines = [line for table in status.tables(told, 0.0) for line in plain(table, 80)]
    text = "\n".join(lines)
    assert max(map(len, lines)) <= 80
    assert "\x1b" not in text
    assert "rails: main 8.2 V 1.25 A 10.25 W" in text
    assert "WRONG: rail main: 8.2 V is below 9 V" in text
    assert "position 48.7668616 11.4320680 by gnss, 0.2 s ago, fix full" in text
    assert "time within 25 ns, locked" in text


def test_a_status_of_a_station_without_a_board_has_no_such_section():
    assert list(board.section(STATUS)) == []


@given(st.dictionaries(st.sampled_from([*BOARD, *POSITION]), anything), anything)
def test_whatever_a_station_calls_its_board_is_shown(told, line):
    for answer in ({"board": told, "timeline": line}, {"board": BOARD | told, "timeline": [told]}):
        for table in [*board_command.tables(answer), *board.section({"board": answer["board"], "position": told})]:
            assert all(len(shown) <= 80 and (shown.isprintable() or not shown) for shown in plain(table, 80))


def test_a_running_station_is_asked_for_its_self_test(tmp_path, monkeypatch, capsys, block):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    answer = json.dumps({"ok": True, "status": STATUS, "rows": ROWS}).encode() + b"\n"
    with FakeControl(tmp_path / f"captain-{block}.sock", answer) as station:
        assert cli.main(["selftest", "--set", f"endpoint.from_users={block}"]) == 1
    assert json.loads(station.lines[-1])["do"] == "selftest"
    said = capsys.readouterr().out.splitlines()
    assert said[0] == "1 of 2 capabilities work"
    assert said[3].split() == ["fan", "no", "NO", "none"]
    assert "  fan: plug it in" in said


def test_every_row_of_a_self_test_decides_about_the_exit_code(monkeypatch, capsys):
    for rows, code in ((ROWS[:1], 0), (ROWS, 1), ([], 1)):
        monkeypatch.setattr(selftest, "_alone", lambda _, rows=rows: {"rows": rows})
        assert cli.main(["selftest", "--json", "--board", "none", "--set", "endpoint.from_users=5999"]) == code
        assert json.loads(capsys.readouterr().out) == rows


def test_a_station_is_asked_for_its_self_test_at_its_control_socket(tmp_path, capsys):
    with control(tmp_path, rows=ROWS[:1]) as station:
        assert cli.main(["selftest", "--json", "--control", str(station.path)]) == 0
    assert json.loads(station.lines[-1])["do"] == "selftest"
    assert json.loads(capsys.readouterr().out) == ROWS[:1]
    assert cli.main(["selftest", "--control", str(tmp_path / "nobody")]) == 1
    assert "no station answers" in capsys.readouterr().err


def test_selftest_of_a_running_station_names_its_command_and_one_alone_does_not(tmp_path, monkeypatch, capsys):
    slot = ROWS[1] | {"capability": "slot gnss", "ask": "`captain slot cycle gnss` tries again"}
    with control(tmp_path, rows=[slot]) as station:
        assert cli.main(["selftest", "--control", str(station.path)]) == 1
    assert "  slot gnss: plug it in; `captain slot cycle gnss`" in capsys.readouterr().out
    monkeypatch.setattr(selftest, "_alone", lambda _: {"rows": [slot]})
    assert cli.main(["selftest", "--board", "none", "--set", "endpoint.from_users=5999"]) == 1
    assert "  slot gnss: plug it in\n" in capsys.readouterr().out


def test_an_empty_slot_decides_about_nothing(monkeypatch, capsys):
    empty = {"capability": "slot free", "is_present": False, "works": None, "value": "empty", "remedy": "", "ask": ""}
    for rows, code in (([ROWS[0], empty], 0), ([*ROWS, empty], 1), ([empty], 1)):
        monkeypatch.setattr(selftest, "_alone", lambda _, rows=rows: {"rows": rows})
        assert cli.main(["selftest", "--board", "none", "--set", "endpoint.from_users=5999"]) == code
        said = capsys.readouterr().out.splitlines()
        assert said[0].startswith(f"{1 if ROWS[0] in rows else 0} of {len(rows) - 1} ")
        assert said[len(rows) + 1].split() == ["slot", "free", "no", "empty"]


def test_a_station_is_started_for_a_self_test_where_none_runs(capsys):
    air = ["--set", "interfaces.g5.driver=udp", "--set", "interfaces.g5.listen=127.0.0.1:0"]
    assert cli.main(["selftest", "--json", "--board", "none", "--set", "endpoint.from_users=5999", *air]) == 0
    (row,) = json.loads(capsys.readouterr().out)
    assert (row["capability"], row["works"]) == ("interface g5", True)
