import argparse
import io
import json

import pytest
from hypothesis import given as generated
from hypothesis import strategies as st

from firmware import cli
from firmware.client import client
from firmware.client.sending.flights import Flights
from firmware.commands import send
from tests.firmware.commands.fake import FakeStation
from tests.screens.terminal import Terminal

CAM = "02020000053900010203"


def confirm(options: dict[str, object], outcome: str, **more: object) -> dict[str, object]:
    return {"label": options["label"], "type": "cam", "outcome": outcome, **more}


def sent_by(*interfaces: str):
    def answer(options: dict[str, object], number: int) -> list[dict[str, object]]:
        accepted = confirm(options, "accepted", interfaces=list(interfaces))
        return [
            accepted,
            *(confirm(options, "sent", interface=name, queue_us=12.0, send_us=4.0) for name in interfaces),
        ]

    return answer


def refused(options: dict[str, object], number: int) -> list[dict[str, object]]:
    return [confirm(options, "refused", reason="short-pdu", meaning="too short")]


def sent(station: FakeStation, *options: str) -> int:
    return cli.main(["send", *station.options, "--rate", "0", *options])


def test_a_sent_message_is_told_with_its_interface_and_times(capsys):
    with FakeStation(answer=sent_by("g5")) as station:
        assert sent(station, CAM) == 0
    said = capsys.readouterr().out
    assert "the argument: cam 10 octets: sent by g5, 12 us queued, 4 us to send" in said
    assert "1 given to the station: 1 sent" in said
    assert "\x1b" not in said
    assert station.requests[0][:2] == [b"v2x.", bytes.fromhex(CAM)]


def test_a_message_in_json_is_told_with_the_octets_of_its_pdu(capsys):
    def answer(options: dict[str, object], number: int) -> list[dict[str, object]]:
        return [one | {"octets": 40} for one in sent_by("g5")(options, number)]

    with FakeStation(answer=answer) as station:
        assert sent(station, '{"edition": "cam", "fields": {"speed": 13.9}}') == 0
    assert "cam 40 octets: sent by g5" in capsys.readouterr().out


def test_a_refused_message_in_json_is_told_with_the_octets_of_its_json(capsys):
    with FakeStation(answer=refused) as station:
        assert sent(station, '{"edition": "cam", "fields": {}}') == 1
    assert "cam 32 octets of JSON: refused" in capsys.readouterr().out


def test_the_options_go_along_in_the_third_frame():
    wishes = ["--type", "CAM", "--interface", "g5", "--interface", "5g", "--label", "mine", "--lifetime", "2"]
    wishes += ["--traffic-class", "3", "--priority", "1", "--btp-port", "2001", "--hop-limit", "4"]
    with FakeStation(answer=sent_by("g5", "5g")) as station:
        assert sent(station, CAM, *wishes, "--area", "rectangle:48.5,-11.25,500,20,90") == 0
    envelope, _, options = station.requests[0]
    assert envelope == b"v2x.cam."
    assert json.loads(options) == {
        "label": "mine/1",
        "interfaces": ["g5", "5g"],
        "lifetime_s": 2.0,
        "traffic_class": 3,
        "priority": 1,
        "btp_port": 2001,
        "hop_limit": 4,
        "area": {
            "shape": "rectangle",
            "latitude": 48.5,
            "longitude": -11.25,
            "distance_a": 500,
            "distance_b": 20,
            "angle": 90,
        },
    }


def test_the_station_accepts_the_options_that_this_command_writes():
    from firmware.routing import options

    parser = argparse.ArgumentParser()
    send.arguments(parser)
    text = f"{CAM} --interface g5 --label a --lifetime 2 --traffic-class 3 --priority 1 --btp-port 2001"
    asked = send.wishes(parser.parse_args([*text.split(), "--area", "circle:48,11,500", "--hop-limit", "4"]))
    parsed = options.parse(json.dumps({**asked, "label": "a/1"}).encode())
    assert parsed.options.interfaces == ("g5",)
    assert parsed.area is not None
    assert parsed.area.distance_a == 500


def test_one_interface_of_two_is_enough(capsys):
    def half(options: dict[str, object], number: int) -> list[dict[str, object]]:
        dropped = confirm(options, "dropped", interface="5g", reason="link-down", meaning="the link went down")
        return [*sent_by("g5")(options, number)[1:], dropped, confirm(options, "accepted", interfaces=["g5", "5g"])]

    with FakeStation(answer=half) as station:
        assert sent(station, CAM) == 0
    assert "dropped by 5g: link-down (the link went down)" in capsys.readouterr().out


def test_a_refused_message_is_told_with_reason_and_meaning_and_ends_in_1(capsys):
    with FakeStation(answer=refused) as station:
        assert sent(station, "02") == 1
    said = capsys.readouterr().out
    assert "refused: short-pdu (too short)" in said
    assert "(station)  refused      1" in said


def test_a_message_without_an_interface_to_leave_by_was_not_sent(capsys):
    with FakeStation(answer=sent_by()) as station:
        assert sent(station, CAM) == 1
    assert "accepted, but for no interface" in capsys.readouterr().out


def test_a_message_that_nobody_confirms_was_not_sent(capsys):
    with FakeStation() as station:
        assert sent(station, CAM, "--wait", "0.05") == 1
    assert "no confirm came" in capsys.readouterr().out


def test_an_interface_that_says_nothing_is_named(capsys):
    with FakeStation(answer=lambda options, _: [confirm(options, "accepted", interfaces=["g5"])]) as station:
        assert sent(station, CAM, "--wait", "0.05") == 1
    assert "no confirm from g5" in capsys.readouterr().out


def test_a_station_that_stops_confirming_is_told_and_not_waited_for(monkeypatch, capsys):
    monkeypatch.setattr(client, "ANSWER_S", 0.1)
    with FakeStation() as station:
        assert sent(station, CAM, "--count", "100") == 1
    said = capsys.readouterr()
    assert "no confirm came for 32 messages within 0.1 s" in said.err
    assert "32 unconfirmed" in said.out


def test_all_are_sent_as_often_as_asked_and_only_what_failed_is_told_one_by_one(tmp_path, capsys):
    (tmp_path / "two.hex").write_text(f"{CAM}\n{CAM}\n")

    def all_but_the_7th(options: dict[str, object], number: int) -> list[dict[str, object]]:
        return (refused if number == 7 else sent_by("g5"))(options, number)

    with FakeStation(answer=all_but_the_7th) as station:
        assert sent(station, str(tmp_path), "--count", "50") == 1
    said = capsys.readouterr().out
    assert len(station.requests) == 100
    assert said.count("octets:") == 1
    assert "100 given to the station: 1 refused, 99 sent" in said


def test_types_of_a_list_become_envelopes(tmp_path):
    (tmp_path / "list.json").write_text(json.dumps([{"type": "CAM", "hex": CAM}, {"hex": CAM}]))
    with FakeStation(answer=sent_by("g5")) as station:
        assert sent(station, str(tmp_path / "list.json")) == 0
    assert [frames[0] for frames in station.requests] == [b"v2x.cam.", b"v2x."]


def test_standard_input_is_sent(monkeypatch):
    monkeypatch.setattr("sys.stdin", given(f"{CAM}\n{CAM}\n"))
    with FakeStation(answer=sent_by("g5")) as station:
        assert sent(station, "-") == 0
    assert len(station.requests) == 2


def test_standard_input_that_is_closed_is_no_message(monkeypatch, capsys):
    monkeypatch.setattr("sys.stdin", None)
    with FakeStation(answer=sent_by("g5")) as station:
        assert sent(station, "-") == 1
    assert "standard input: it holds no PDU" in capsys.readouterr().err


def given(text: str) -> io.TextIOWrapper:
    return io.TextIOWrapper(io.BytesIO(text.encode()))


@pytest.mark.parametrize("is_file", [True, False])
def test_an_invalid_line_of_27_is_reported_and_the_26_others_are_sent(tmp_path, monkeypatch, capsys, is_file):
    text = "\n".join([*[CAM] * 12, "02zz", *[CAM] * 14])
    (tmp_path / "27.hex").write_text(text)
    monkeypatch.setattr("sys.stdin", given(text))
    with FakeStation(answer=sent_by("g5")) as station:
        assert sent(station, str(tmp_path / "27.hex") if is_file else "-") == 1
    said = capsys.readouterr()
    assert len(station.requests) == 26
    assert "line 13: character 3, 'z', is not a hexadecimal digit" in said.err
    assert "26 given to the station: 26 sent; 1 invalid, not sent" in said.out


def test_an_invalid_line_sent_as_often_as_asked_is_reported_once(tmp_path, capsys):
    (tmp_path / "two.hex").write_text(f"{CAM}\n02zz\n")
    with FakeStation(answer=sent_by("g5")) as station:
        assert sent(station, str(tmp_path), "--count", "3", "--json") == 1
    out, err = capsys.readouterr()
    assert len(station.requests) == 3
    assert err.count("is not a hexadecimal digit") == 1
    told = [json.loads(line) for line in out.splitlines()]
    assert [one["outcome"] for one in told] == ["invalid", "sent", "sent", "sent"]
    assert "two.hex: line 2: character 3" in told[0]["error"]


def test_2003_invalid_lines_are_three_and_their_count(tmp_path, capsys):
    (tmp_path / "bad.hex").write_text("02zz\n" * 2003)
    assert cli.main(["send", str(tmp_path / "bad.hex")]) == 1
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 5
    assert said[-1].startswith("captain: 2000 more of this kind, the last: ")
    assert "line 2003: character 3, 'z'" in said[-1]


def test_of_2003_messages_that_are_refused_three_are_told_and_all_are_counted(tmp_path, capsys):
    (tmp_path / "short.hex").write_text("02\n" * 2003)
    with FakeStation(answer=refused) as station:
        assert sent(station, str(tmp_path)) == 1
    said = capsys.readouterr().out
    assert said.count("refused: short-pdu (too short)") == 3
    assert "2003 given to the station: 2003 refused" in said


def test_a_terminal_shows_a_bar_and_it_is_gone_at_the_end(monkeypatch):
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "80")
    out, err = Terminal(), Terminal()
    monkeypatch.setattr("sys.stdout", out)
    monkeypatch.setattr("sys.stderr", err)
    with FakeStation(answer=sent_by("g5")) as station:
        assert sent(station, CAM, "--count", "50") == 0
    assert "50/50" in out.getvalue()
    assert out.getvalue().count("\x1b[2K") > 0
    assert "50 given to the station: 50 sent" in out.getvalue()


def test_json_is_one_object_for_each_message(capsys):
    with FakeStation(answer=sent_by("g5")) as station:
        assert sent(station, CAM, "--json", "--label", "a") == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["label"], found["outcome"], found["octets"]) == ("a/1", "sent", 10)
    assert found["hops"][0]["interface"] == "g5"


def test_without_confirms_it_is_enough_that_the_station_took_it(capsys):
    with FakeStation() as station:
        assert sent(station, CAM, CAM, "--no-confirm") == 0
    assert "2 given to the station" in capsys.readouterr().out


def test_rubbish_among_the_confirms_is_counted_and_not_fatal(capsys):
    def odd(options: dict[str, object], number: int) -> list[dict[str, object]]:
        label = options["label"]
        strange = [{"label": 7}, {"label": label, "outcome": "eaten"}, {"label": "another's", "outcome": "sent"}]
        return [*strange, *sent_by("g5")(options, number)]

    rubbish = [(b"confirm.cam.", b"{"), (b"confirm.",), (b"confirm.cam.", b"[]")]
    with FakeStation(reports=rubbish, answer=odd) as station:
        assert sent(station, CAM) == 0
    assert "4 unreadable reports" in capsys.readouterr().out


@pytest.mark.parametrize("port", ["--pull", "--report"])
def test_nobody_at_a_port_is_told_with_a_remedy(capsys, port):
    with FakeStation() as station:
        assert cli.main(["send", *station.options, port, "1", CAM]) == 1
    said = capsys.readouterr().err
    assert "no station answers at 127.0.0.1:1" in said
    assert "captain run" in said


def test_wrong_hexadecimal_is_refused_before_anything_is_sent(capsys):
    assert cli.main(["send", "02x2"]) == 1
    assert "character 3, 'x'" in capsys.readouterr().err


@pytest.mark.parametrize(
    "options",
    [
        ["--rate", "-1"],
        ["--rate", "nan"],
        ["--interval", "0"],
        ["--rate", "1", "--interval", "1"],
        ["--count", "0"],
        ["--traffic-class", "256"],
        ["--priority", "8"],
        ["--hop-limit", "0"],
        ["--type", "a.b"],
        ["--lifetime", "0"],
        ["--area", "circle:1,2"],
        ["--area", "circle:1,2,3,4"],
        ["--area", "square:1,2,3"],
        ["--area", "circle:1,2,x"],
        ["--area", "circle:91,2,3"],
        ["--area", "circle:1,-181,3"],
        ["--area", "circle:1,2,65536"],
        ["--area", "rectangle:1,2,3,4,361"],
        ["--area", "ellipse:1,2,nan,4"],
        ["--format", "pcap"],
    ],
)
def test_an_option_that_cannot_be_meant_is_wrong_usage(options):
    with pytest.raises(SystemExit) as ended:
        cli.main(["send", CAM, *options])
    assert ended.value.code == 2


@pytest.mark.parametrize(("options", "seconds"), [([], 0.1), (["--rate", "0"], 0.0), (["--interval", "2"], 2.0)])
def test_the_pace_is_a_rate_or_an_interval(options, seconds):
    parser = argparse.ArgumentParser()
    send.arguments(parser)
    assert send.interval(parser.parse_args([CAM, *options])) == pytest.approx(seconds)


def test_messages_on_their_way_are_bounded():
    flights = Flights(most=3)
    given_up = [flights.depart(str(number), "", 1) for number in range(10)]
    assert [flight.label for flight in given_up if flight] == [str(number) for number in range(7)]
    assert flights.outcomes == {"unconfirmed": 7}


confirms = st.dictionaries(
    st.sampled_from(["label", "outcome", "interfaces", "interface", "reason", "queue_us"]),
    st.sampled_from(["a", "accepted", "sent", "refused", "dropped", "g5", ["g5"], [1], None, 1.5, float("inf")]),
)


@generated(st.lists(confirms))
def test_no_confirm_of_a_peer_is_fatal_and_each_message_ends_once(said):
    flights = Flights()
    flights.depart("a", "", 1)
    over = [flight for one in said if (flight := flights.feed(one)) is not None]
    over += [flights.give_up(label) for label in list(flights.open)]
    assert len(over) == 1
    assert sum(flights.outcomes.values()) == 1
