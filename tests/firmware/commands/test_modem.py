"""captain modem: what is shown of a modem, what is asked of one, and with which exit status."""

import argparse
import json

import pytest

from board.runtime.errors import StationError
from firmware import cli
from firmware.client.show.table import plain
from firmware.commands import modem
from tests.firmware.commands.fake import STATUS, FakeControl

MODEM = {
    "driver": "sim8202g",
    "technology": "5g",
    "state": "up",
    "why": "wwan0 has 10.64.1.2",
    "since_s": 61.2,
    "details": {
        "step": "up",
        "model": "SIMCOM_SIM8202G-M2",
        "firmware": "LE13B04SIM8202M44A-M2",
        "usb": "1e0e:9001",
        "sim": "ready",
        "pin_attempts": 3,
        "registration": "home",
        "operator": "Telekom.de",
        "cell": {
            "access": "5g-nsa",
            "mode": "Online",
            "plmn": "460-11",
            "area": 23070,
            "cell": 187214780,
            "physical_cell": 257,
            "band": "EUTRAN-BAND3",
            "channel": 1850,
            "strength": {"rsrp_dbm": -85.0, "rsrq_db": -9.4, "rssi_dbm": -54.5, "snr_db": 15.0},
            "leg": {
                "physical_cell": 644,
                "band": "NR5G_BAND78",
                "channel": 627264,
                "strength": {"rsrp_dbm": -96.0, "rsrq_db": -12.0, "snr_db": 9.5},
            },
        },
        "rssi_dbm": -73,
        "temperature_c": 38,
        "device": "wwan0",
        "addresses": ["10.64.1.2"],
        "recoveries": 2,
        "misread": 0,
        "garbage_octets": 0,
        "age_s": {"registration": 3.2, "cell": 3.1, "module": 43.0},
    },
}
SHOWN = """\
cellular: up for 61 s: wwan0 has 10.64.1.2
what         value
step         is up
network      Telekom.de, home, 5g-nsa, 3.2 s ago
cell         460-11, area 23070, cell 187214780
radio        EUTRAN-BAND3, physical cell 257, channel 1850
signal       RSRP -85 dBm, RSRQ -9.4 dB, SNR 15 dB, RSSI -73 dBm, 3.1 s ago
5G radio     NR5G_BAND78, physical cell 644, channel 627264
5G signal    RSRP -96 dBm, RSRQ -12 dB, SNR 9.5 dB
bearer       wwan0, 10.64.1.2
card         ready, 3 attempts for its PIN
modem        SIMCOM_SIM8202G-M2, LE13B04SIM8202M44A-M2, 1e0e:9001
temperature  38 C, 43 s ago
counted      2 resets"""


def run(tmp_path, *words, interfaces=None, **more):
    """Exit status, and what the station was asked."""
    interfaces = {**STATUS["interfaces"], "cellular": MODEM} if interfaces is None else interfaces
    answer = {"ok": True, "status": {**STATUS, "interfaces": interfaces}, **more}
    parser = argparse.ArgumentParser()
    modem.arguments(parser)
    with FakeControl(tmp_path / "control", json.dumps(answer).encode() + b"\n") as control:
        code = modem.main(parser.parse_args([*words, "--control", str(control.path)]))
    return code, [json.loads(line) for line in control.lines]


def test_a_modem_is_shown_in_eighty_columns():
    assert "\n".join(plain(modem.table("cellular", MODEM), 80)) == SHOWN


def test_an_age_without_its_reading_is_not_shown():
    details = {"age_s": MODEM["details"]["age_s"], "registration": "home"}
    lines = plain(modem.table("cellular", MODEM | {"details": details}), 80)
    assert [line.split() for line in lines[2:]] == [["network", "home,", "3.2", "s", "ago"]]


def test_the_modems_of_a_station_are_shown_and_no_other_interface(tmp_path, capsys):
    assert run(tmp_path, "status")[0] == 0
    shown = capsys.readouterr().out
    assert "cellular: up for 61 s" in shown
    assert "g5" not in shown


def test_json_has_all_of_it(tmp_path, capsys):
    run(tmp_path, "status", "--interface", "cellular", "--json")
    assert json.loads(capsys.readouterr().out) == {"cellular": MODEM}


@pytest.mark.parametrize(("result", "code"), [("OK", 0), ("+CME ERROR: 100", 1), ("ERROR", 1)])
def test_a_command_is_sent_and_its_answer_shown_as_it_came(tmp_path, capsys, result, code):
    status, asked = run(tmp_path, "at", "AT+CSQ", command="AT+CSQ", lines=["+CSQ: 20,99"], result=result)
    assert (status, capsys.readouterr().out) == (code, f"+CSQ: 20,99\n{result}\n")
    wanted = {
        "do": "operate",
        "interface": "cellular",
        "ask": "at",
        "arguments": {"command": "AT+CSQ", "force": False},
    }
    assert {key: asked[-1][key] for key in wanted} == wanted


def test_a_reset_is_asked_of_the_only_modem(tmp_path, capsys):
    code, asked = run(tmp_path, "reset")
    assert (code, capsys.readouterr().out) == (0, "cellular: reset begun; `captain modem status` tells more\n")
    assert (asked[-1]["ask"], asked[-1]["arguments"]) == ("reset", {})


def test_of_two_modems_one_has_to_be_named(tmp_path):
    both = {"front": MODEM, "rear": MODEM}
    with pytest.raises(StationError, match="has 2 modems"):
        run(tmp_path, "reset", interfaces=both)
    (tmp_path / "control").unlink()
    _, asked = run(tmp_path, "reset", "--interface", "rear", interfaces=both)
    assert asked[-1]["interface"] == "rear"


@pytest.mark.parametrize(
    ("words", "what"),
    [
        (("status", "--interface", "g5"), "no modem 'g5'"),
        (("at",), "give COMMAND"),
        (("reset", "AT"), "takes no COMMAND"),
    ],
)
def test_what_cannot_be_asked_is_refused(tmp_path, words, what):
    with pytest.raises(StationError, match=what):
        run(tmp_path, *words)


@pytest.mark.parametrize("words", [["at"], ["status", "AT"]])
def test_a_command_where_none_belongs_and_none_where_one_does_is_wrong_usage(words):
    assert cli.main(["modem", *words]) == 2


def test_a_station_without_a_modem_says_so(tmp_path):
    with pytest.raises(StationError, match="no modem"):
        run(tmp_path, "status", interfaces=STATUS["interfaces"])


@pytest.mark.parametrize("details", [{}, {"cell": 3, "addresses": "none", "rssi_dbm": "x", "sim": None}, None])
def test_what_a_peer_left_out_or_wrote_otherwise_is_shown_as_absent(details):
    lines = plain(modem.table("cellular", {**MODEM, "details": details}), 80)
    assert lines[0].startswith("cellular: up")
