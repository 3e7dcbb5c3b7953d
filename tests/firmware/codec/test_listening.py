"""Fields in `captain listen`, with a library whose editions differ."""

import json

import pytest

from firmware import cli
from firmware.codec import fields
from tests.firmware.codec.standin import DOOR, NEW, octets
from tests.firmware.commands.fake import FakeStation, Frames, delivered
from tests.said import tells

GOOD = octets(DOOR, 1, 2, 3)
BAD = octets(DOOR, 1, 99, 3)


def listened(reports: list[Frames], *options: str) -> int:
    with FakeStation(reports=reports) as station:
        return cli.main(["listen", *station.options, *options])


def test_the_table_says_what_the_last_message_of_each_station_says(standin, capsys, monkeypatch):
    monkeypatch.setitem(fields.LOOKS, "door", (lambda *_: "wide open",))
    assert listened([delivered("door", GOOD)], "--count", "1") == 0
    said = capsys.readouterr().out
    assert "type  station  count  per s  dBm    ago  says" in said
    assert "0.0 s  wide open" in said
    assert "octets" not in said


@pytest.mark.parametrize("error", [ValueError("no digits"), MemoryError("no digits")])
def test_message_that_cannot_be_looked_at_is_marked_and_the_table_continues(standin, capsys, monkeypatch, error):
    def look(*_: object) -> str:
        raise error

    monkeypatch.setitem(fields.LOOKS, "door", (look,))
    assert listened([delivered("door", GOOD)], "--count", "1") == 0
    assert "0.0 s  ! no digits" in capsys.readouterr().out


def test_a_message_that_does_not_decode_is_in_the_table_with_the_reason(standin, capsys):
    assert listened([delivered("door", GOOD), delivered("door", BAD)], "--count", "2") == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "door 1337 2 - 0.0 s ! 1 bad: bo" in said
    assert (
        "! door of station 1337: door-1.1: body.height: bit 56: out of range: 99 is not in 0..9; it was damaged" in said
    )
    assert BAD.hex() in said


def test_one_bad_message_among_good_ones_stays_visible(standin, capsys):
    assert listened([delivered("door", BAD), delivered("door", GOOD)], "--count", "2") == 0
    assert "! 1 bad" in capsys.readouterr().out


def test_without_the_library_the_table_has_headers_only(without_library, capsys):
    assert listened([delivered("door", BAD)], "--count", "1") == 0
    said = capsys.readouterr().out
    assert "octets" in said
    assert "says" not in said
    assert "!" not in said


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--fields", "height,nope"], "'nope': no message that is listened to has a field nope"),
        (["--fields", "heigth"], "did you mean height?"),
        (["--fields", "Height"], "did you mean height?"),
        (["--fields", "body.stationID"], "'body.stationID': body holds no stationID"),
        (["--type", "66", "--fields", "height"], "no message that is listened to has a field height"),
    ],
)
def test_a_field_that_no_message_has_is_refused_before_the_first_comes(standin, capsys, options, words):
    assert cli.main(["listen", *options]) == cli.USAGE_ERROR
    told = capsys.readouterr()
    assert told.err.startswith("captain: --fields: ")
    assert words in told.err


def test_of_a_type_that_only_the_station_knows_any_field_may_be_wanted(standin, capsys):
    assert listened([], "--type", "saem", "--fields", "height", "--duration", "0.1") == 0


@pytest.mark.parametrize("options", [["--full"], ["--fields", "a"], ["--json", "--decode"]])
def test_fields_that_are_asked_for_need_the_library(without_library, capsys, options):
    assert listened([], *options) == 1
    assert "make codec" in capsys.readouterr().err


def test_json_lines_carry_the_decoded_message_or_the_reason(standin, capsys):
    air = [delivered("door", GOOD), delivered("door", BAD), delivered("ball", octets(NEW, 1, 2))]
    assert listened(air, "--json", "--decode", "--count", "3") == 0
    good, bad, ball = map(json.loads, capsys.readouterr().out.splitlines())
    assert (good["edition"], good["message"]["body"]["height"], good["hex"]) == ("door-1.1", 2, GOOD.hex())
    assert {"edition", "message"}.isdisjoint(bad)
    assert (bad["nearest_edition"], bad["bit"], bad["path"]) == ("door-1.1", 56, "body.height")
    assert bad["hex"] == BAD.hex()
    assert "bit 56" in bad["error"]
    assert bad["hint"]
    assert ball["edition"] == "ball-2.1"


def test_json_without_decode_is_as_it_was(standin, capsys):
    assert listened([delivered("door", GOOD)], "--json", "--count", "1") == 0
    assert {"edition", "message", "error"}.isdisjoint(json.loads(capsys.readouterr().out))


def test_all_fields_of_each_message_can_be_shown(standin, capsys):
    assert listened([delivered("door", GOOD), delivered("door", BAD)], "--full", "--count", "2") == 0
    said = capsys.readouterr().out
    assert "door-1.1: a standard, 9 octets, " in said
    assert "  height: 2\n" in said
    assert "door 1337: door-1.1: body.height: bit 56: out of range: 99 is not in 0..9; it was damaged" in said
    assert BAD.hex() in said


def test_fields_that_are_asked_for_are_a_line_of_each_message(standin, capsys):
    air = [delivered("door", GOOD), delivered("door", BAD), delivered("ball", octets(NEW, 1, 2))]
    assert listened(air, "--fields", "height,body.depth", "--count", "3") == 0
    good, bad, ball = capsys.readouterr().out.splitlines()
    assert good.endswith(" door 1337: height=2 m  body.depth=3 m")
    assert "body.height: bit 56: out of range" in bad
    assert tells(ball, "ball 1337: ", "none")


def test_some_fields_of_each_message_for_a_program(standin, capsys):
    assert listened([delivered("door", GOOD)], "--json", "--fields", "height", "--count", "1") == 0
    assert json.loads(capsys.readouterr().out)["fields"] == {"body.height": "2 m"}


def test_only_the_stations_that_are_wanted_are_shown(standin, capsys):
    other = GOOD[:2] + (4711).to_bytes(4) + GOOD[6:]
    options = ("--station-id", "4711", "--json", "--count", "1")
    assert listened([delivered("door", GOOD), delivered("door", other)], *options) == 0
    assert json.loads(capsys.readouterr().out)["station_id"] == 4711


@pytest.mark.parametrize(
    "options",
    [["--full", "--fields", "a"], ["--fields", " ,"], ["--full", "--headers"], ["--station-id", "4294967296"]],
)
def test_options_that_contradict_each_other_are_wrong_usage(options):
    with pytest.raises(SystemExit) as ended:
        cli.main(["listen", *options])
    assert ended.value.code == cli.USAGE_ERROR


@pytest.mark.parametrize("options", [["--decode"], ["--full", "--json"]])
def test_a_form_without_what_it_is_of_is_wrong_usage(options, capsys):
    assert cli.main(["listen", *options]) == cli.USAGE_ERROR
    told = capsys.readouterr()
    assert "--decode needs --json" in told.err
    assert ("--json" in options) is ("--decode needs --json" in told.out)
