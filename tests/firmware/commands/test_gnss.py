"""captain gnss: what is shown of a receiver, and which one is reset."""

import argparse
import json

import pytest

from board.runtime.errors import StationError
from firmware.client.show.table import plain
from firmware.commands import gnss
from tests.firmware.commands.fake import STATUS, FakeControl

RECEIVER = {
    "driver": "zed_f9p",
    "technology": "gnss",
    "state": "up",
    "why": "ZED-F9P HPG 1.32 at ttyACM0",
    "since_s": 42.4,
    "details": {
        "receiver": "ubx",
        "fix": "3d",
        "carrier": "fixed",
        "satellites": 28,
        "horizontal_mm": 14,
        "vertical_mm": 28,
        "age_s": 0.17,
        "jumps": 1,
        "withheld": 4,
        "port": "/dev/ttyACM0",
        "module": "ZED-F9P",
        "firmware": "HPG 1.32",
        "protocol": "27.31",
        "jamming": "none",
        "spoofing": "indicated",
        "antenna": "ok",
        "antenna_power": "on",
        "leap_seconds": 18,
        "leap_source": "gps",
        "leap_change": {"seconds": 1, "unix": 1798761600},
        "pdop": 1.18,
        "utc_resolved": True,
        "refused": ["CFG-MSGOUT-UBX_SEC_SIG_USB"],
        "bringups": 1,
        "garbage_octets": 0,
        "corrections": {
            "source": "tcp://192.0.2.1:2101",
            "state": "connected",
            "frames": 612,
            "last_s": 0.4,
            "age_s_below": 2,
            "used": 610,
            "unused": 2,
            "damaged": 0,
        },
    },
}
SHOWN = """\
gnss: up for 42 s: ZED-F9P HPG 1.32 at ttyACM0
what         value
fix          3d, RTK fixed, 28 satellites, 0.2 s ago
accuracy     0.014 m horizontal, 0.028 m vertical
time         18 leap seconds from gps, +1 at Unix time 1798761600
signals      jamming none, spoofing indicated
antenna      ok, power on
corrections  tcp://192.0.2.1:2101, connected
             612 frames, younger than 2 s, 610 used, 2 unused, 0 damaged
receiver     module ZED-F9P, firmware HPG 1.32, protocol 27.31
port         /dev/ttyACM0
counted      1 jump, 4 withheld, 1 bringup
  not known to its firmware: CFG-MSGOUT-UBX_SEC_SIG_USB"""


def run(tmp_path, *words, interfaces=None):
    """Exit status, and what the station was asked."""
    interfaces = {**STATUS["interfaces"], "gnss": RECEIVER} if interfaces is None else interfaces
    answer = {"ok": True, "status": {**STATUS, "interfaces": interfaces}, "reset": "cold"}
    parser = argparse.ArgumentParser()
    gnss.arguments(parser)
    with FakeControl(tmp_path / "control", json.dumps(answer).encode() + b"\n") as control:
        code = gnss.main(parser.parse_args([*words, "--control", str(control.path)]))
    return code, [json.loads(line) for line in control.lines]


def test_a_receiver_is_shown_in_eighty_columns():
    assert "\n".join(plain(gnss.table("gnss", RECEIVER), 80)) == SHOWN


def test_the_receivers_of_a_station_are_shown_and_no_other_interface(tmp_path, capsys):
    assert run(tmp_path, "status")[0] == 0
    shown = capsys.readouterr().out
    assert "gnss: up for 42 s" in shown
    assert "g5" not in shown


def test_json_has_all_of_it(tmp_path, capsys):
    run(tmp_path, "status", "gnss", "--json")
    assert json.loads(capsys.readouterr().out) == {"gnss": RECEIVER}


def test_a_reset_is_asked_of_the_only_receiver(tmp_path, capsys):
    code, asked = run(tmp_path, "reset", "--kind", "cold")
    assert (code, capsys.readouterr().out) == (0, "gnss: cold reset\n")
    wanted = {"do": "operate", "interface": "gnss", "ask": "reset", "arguments": {"kind": "cold"}}
    assert {key: asked[-1][key] for key in wanted} == wanted


def test_of_two_receivers_one_has_to_be_named(tmp_path):
    both = {"front": RECEIVER, "rear": RECEIVER}
    with pytest.raises(StationError, match="has 2 receivers"):
        run(tmp_path, "reset", interfaces=both)
    (tmp_path / "control").unlink()
    _, asked = run(tmp_path, "reset", "rear", interfaces=both)
    assert asked[-1]["interface"] == "rear"


@pytest.mark.parametrize(
    ("words", "what"), [(("status", "g5"), "no receiver 'g5'"), (("reset", "x"), "no receiver 'x'")]
)
def test_what_is_no_receiver_is_said_with_those_that_are(tmp_path, words, what):
    with pytest.raises(StationError, match=what) as caught:
        run(tmp_path, *words)
    assert "it has gnss" in caught.value.hint


def test_a_station_without_a_receiver_says_so(tmp_path):
    with pytest.raises(StationError, match="no GNSS receiver"):
        run(tmp_path, "status", interfaces=STATUS["interfaces"])


@pytest.mark.parametrize("details", [{}, {"fix": 3, "satellites": "many", "corrections": [], "refused": None}, None])
def test_what_a_peer_left_out_or_wrote_otherwise_is_shown_as_absent(details):
    lines = plain(gnss.table("gnss", {**RECEIVER, "details": details}), 80)
    assert lines[0].startswith("gnss: up")


def test_before_leap_seconds_are_known_it_is_said():
    details = {**RECEIVER["details"], "leap_seconds": None, "leap_source": "firmware", "utc_resolved": False}
    assert "not known yet" in "\n".join(plain(gnss.table("gnss", {**RECEIVER, "details": details}), 80))
