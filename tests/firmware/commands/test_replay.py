"""captain replay: what goes where, and what it says of the rest."""

import json
import os
import signal
import socket

import pytest

from drivers.message import Area, Position, Shape
from firmware import cli
from firmware.lab.laboratory import vectors
from firmware.recordings import capture
from firmware.replay.ends import StationEnd
from tests.firmware.commands.fake import FakeStation
from tests.firmware.commands.test_send import refused, sent_by
from tests.firmware.replay.test_rewriting import frame_of
from tests.said import tells

PDUS = [one.pdu for one in vectors()]
AREA = Area(Shape.ELLIPSE, Position(487_668_616, 114_320_680), 500, 100, 45)
BEACON = b"\xff" * 6 + bytes(6) + bytes.fromhex("894711001a01001080000000 0100".replace(" ", "")) + bytes(24)


@pytest.fixture
def drive(tmp_path):
    """A capture: a CAM by single hop, a DENM into an area, a beacon, a broken frame."""
    frames = [frame_of(PDUS[1]), frame_of(PDUS[0], AREA), BEACON, frame_of(PDUS[1])[:50]]
    path = tmp_path / "drive.pcap"
    path.write_bytes(
        capture.header() + b"".join(capture.record(one, 10**18 + at * 10**6) for at, one in enumerate(frames))
    )
    return str(path), frames


def test_a_station_is_given_pdus_with_what_their_frames_had(drive, capsys):
    with FakeStation(answer=sent_by("g5")) as station:
        assert cli.main(["replay", drive[0], *station.options]) == 0
    told = capsys.readouterr().err
    assert [frames[:2] for frames in station.requests] == [[b"v2x.", PDUS[1]], [b"v2x.", PDUS[0]]]
    cam, denm = (json.loads(frames[2]) for frames in station.requests)
    del cam["label"], denm["label"]
    assert cam == {"btp_port": 2001, "traffic_class": 1}
    area = {"shape": "ellipse", "latitude": 48.7668616, "longitude": 11.432068, "distance_a": 500}
    assert denm == {
        "btp_port": 2002,
        "traffic_class": 1,
        "hop_limit": 4,
        "area": area | {"distance_b": 100, "angle": 45},
    }
    assert "captain: 2 sent of 4 read" in told
    assert "the station says: 2 sent" in told
    assert "left out: 1: a frame without a message: beacons (first" in told
    assert "left out: 1: a frame without a message: broken: " in told


def test_the_station_takes_the_options_that_it_is_given(drive):
    from firmware.routing import options

    with FakeStation(answer=sent_by("g5")) as station:
        assert cli.main(["replay", drive[0], *station.options]) == 0
    parsed = [options.parse(frames[2]) for frames in station.requests]
    assert [one.area for one in parsed] == [None, AREA]


def test_what_holds_no_message_is_no_replay(tmp_path, capsys):
    (tmp_path / "rubbish").write_bytes(bytes(range(128, 256)) * 30)
    assert cli.main(["replay", str(tmp_path / "rubbish"), "--udp", "127.0.0.1:9"]) == 1
    assert "captain: 0 sent of 1 read" in capsys.readouterr().err


def test_replay_of_an_unreadable_line_names_the_option_for_the_format(tmp_path, capsys):
    (tmp_path / "bad.hex").write_text("no message\n")
    assert cli.main(["replay", str(tmp_path / "bad.hex"), "--udp", "127.0.0.1:9"]) == 1
    told = capsys.readouterr().err
    assert "\\x0a" not in told
    assert "--format" in told


def test_an_end_before_the_beginning_is_refused(drive, capsys):
    assert cli.main(["replay", drive[0], "--udp", "127.0.0.1:9", "--from", "5", "--to", "2"]) == 2
    assert "--to 2 is not after --from 5" in capsys.readouterr().err


def test_a_refusal_of_the_station_is_told_and_makes_it_fail(drive, capsys):
    with FakeStation(answer=refused) as station:
        assert cli.main(["replay", drive[0], *station.options, "--rate", "0"]) == 1
    said = capsys.readouterr()
    assert "2 refused" in said.err
    assert f"not sent: 2: refused: short-pdu (too short) (first {drive[0]}: frame 1)" in said.err
    assert said.out == ""


def test_what_the_station_did_not_send_is_counted_by_why_in_the_summary_alone(drive, capsys):
    with FakeStation(answer=refused) as station:
        assert cli.main(["replay", drive[0], *station.options, "--rate", "0", "--json"]) == 1
    told = json.loads(capsys.readouterr().out)
    assert told["outcomes"] == {"refused": 2}
    assert told["fates"] == {"refused: short-pdu (too short)": 2}


def test_a_link_is_given_whole_frames_broken_ones_and_beacons_among_them(drive, capsys):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ear:
        ear.bind(("127.0.0.1", 0))
        ear.settimeout(5)
        assert cli.main(["replay", drive[0], "--udp", "{}:{}".format(*ear.getsockname()), "--json"]) == 0
        assert [ear.recv(2048) for _ in drive[1]] == drive[1]
    told = json.loads(capsys.readouterr().out)
    assert "error" not in told
    assert (told["read"], told["sent"], told["left_out"], told["unheard"]) == (4, 4, {}, 0)


@pytest.mark.parametrize(
    ("name", "octets", "error"),
    [
        ("absent.pcapng", None, "No such file or directory"),
        ("empty.pcap", b"", "empty.pcap: "),
        ("cut.pcap", (capture.header() + capture.record(bytes(60), 10**18))[:-20], "cut.pcap: "),
        ("other.pcap", capture.header() + capture.record(b"\xff" * 60, 10**18), "no message in what was read"),
        ("bad.hex", b"0202zz\n0202yy\n", "bad.hex: line 1: character 5"),
        ("bad.json", b"{", "bad.json: line 1: "),
    ],
)
def test_a_failed_replay_gives_a_program_the_first_error_in_the_summary(tmp_path, capsys, name, octets, error):
    path = tmp_path / name
    if octets is not None:
        path.write_bytes(octets)
    with FakeStation(answer=sent_by("g5")) as station:
        for end in (["--udp", "127.0.0.1:9"], station.options):
            assert cli.main(["replay", "--json", str(path), *end]) == 1
            told = json.loads(capsys.readouterr().out)
            assert error in told["error"]
            assert told["hint"] == ("check the path" if octets is None else told["hint"])


def test_replay_with_the_former_name_of_its_format_reads_it(drive, capsys):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ear:
        ear.bind(("127.0.0.1", 0))
        there = "{}:{}".format(*ear.getsockname())
        assert cli.main(["replay", "--form", "pcap", drive[0], "--udp", there, "--json"]) == 0
        assert cli.main(["replay", "--form", "hex", drive[0], "--udp", there, "--json"]) == 1


def test_a_refused_message_is_the_error_in_the_summary(drive, capsys):
    with FakeStation(answer=refused) as station:
        assert cli.main(["replay", "--json", drive[0], *station.options, "--rate", "0"]) == 1
    assert json.loads(capsys.readouterr().out)["error"] == (f"{drive[0]}: frame 1: refused: short-pdu (too short)")


def test_replay_to_a_closed_port_gives_error_and_hint_as_json(drive, capsys):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as held:
        held.bind(("127.0.0.1", 0))
        port = held.getsockname()[1]
    assert cli.main(["replay", "--json", drive[0], "--udp", f"127.0.0.1:{port}"]) == 1
    told = json.loads(capsys.readouterr().out)
    assert tells(told["error"], "no receiver", f" {told['unheard']} datagrams")
    assert "receiver first" in told["hint"]


@pytest.mark.parametrize(("framing", "head"), [("pdu", b""), ("btp", bytes.fromhex("07d10000"))])
def test_datagrams_hold_what_the_framing_says(tmp_path, framing, head):
    path = tmp_path / "a.hex"
    path.write_text(PDUS[1].hex())
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ear:
        ear.bind(("127.0.0.1", 0))
        ear.settimeout(5)
        to = "{}:{}".format(*ear.getsockname())
        assert cli.main(["replay", str(path), "--udp", to, "--framing", framing]) == 0
        assert ear.recv(2048) == head + PDUS[1]


def test_what_is_changed_is_changed_and_what_is_lost_is_told(tmp_path, capsys):
    path = tmp_path / "a.hex"
    path.write_text("\n".join([PDUS[1].hex()] * 40))
    with FakeStation(answer=sent_by("g5")) as station:
        wishes = ["--station-id", "4711", "--time", "now", "--shift", "0,100", "--loss", "0.5", "--rate", "0"]
        assert cli.main(["replay", str(path), *station.options, *wishes, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["sent"] == len(station.requests) == 40 - told["way"]["lost"]
    assert told["outcomes"] == {"sent": told["sent"]}
    for frames in station.requests:
        assert frames[1][2:6] == (4711).to_bytes(4)
        assert frames[1] != PDUS[1]


def test_what_cannot_be_read_is_told_and_makes_it_fail(tmp_path, capsys):
    path = tmp_path / "a.hex"
    path.write_text(f"{PDUS[0].hex()}\nnonsense\n")
    with FakeStation(answer=sent_by("g5")) as station:
        assert cli.main(["replay", str(path), *station.options, "--rate", "0"]) == 1
    assert len(station.requests) == 1
    told = capsys.readouterr().err
    assert "line 2" in told
    assert "1 unreadable" in told


@pytest.mark.parametrize("words", ["nan", "-0.1", "1.1", "a tenth"])
def test_a_share_that_is_none_is_told_with_its_limits(words, capsys):
    with pytest.raises(SystemExit):
        cli.main(["replay", "x.hex", f"--loss={words}"])
    assert (
        f"argument --loss: '{words}': not a share between 0 and 1; for example 0.1 for a tenth"
        in capsys.readouterr().err
    )


@pytest.mark.parametrize(
    "words",
    [
        ["-", "--loop"],
        ["x.hex", "--shift", "1"],
        ["x.hex", "--station-id", "-1"],
        ["x.hex", "--burst", "0.1"],
        ["x.hex", "--loss", "1.5"],
        ["x.hex", "--udp", "nowhere"],
        ["x.hex", "--framing", "btp"],
        ["x.hex", "--speed", "2", "--rate", "1"],
    ],
)
def test_wrong_usage_is_told_as_such(words, capsys):
    try:
        status = cli.main(["replay", *words])
    except SystemExit as ended:
        status = int(ended.code or 0)
    assert status == 2
    assert capsys.readouterr().err


def test_replay_of_datagrams_to_a_closed_port_fails_with_their_count(tmp_path, capsys):
    path = tmp_path / "a.hex"
    path.write_text("\n".join([PDUS[1].hex()] * 3))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as holder:
        holder.bind(("127.0.0.1", 0))
        to = "{}:{}".format(*holder.getsockname())
    assert cli.main(["replay", str(path), "--udp", to, "--rate", "0"]) == 1
    assert tells(capsys.readouterr().err, "3 refused: ", "no program")


def test_replay_of_a_folder_without_a_file_is_refused(tmp_path, capsys):
    (tmp_path / "inner").mkdir()
    assert cli.main(["replay", str(tmp_path), "--udp", "127.0.0.1:9"]) == 1
    assert tells(capsys.readouterr().err, f"captain: {tmp_path}: ", "no file")


def test_sigterm_ends_it_with_its_summary(tmp_path, capsys, monkeypatch):
    path = tmp_path / "a.hex"
    path.write_text(PDUS[1].hex())
    end_when_one_is_confirmed(monkeypatch)
    with FakeStation(answer=sent_by("g5")) as station:
        assert cli.main(["replay", str(path), *station.options, "--loop"]) == 0
    assert "captain: the station says: 1 sent" in capsys.readouterr().err


def end_when_one_is_confirmed(monkeypatch: pytest.MonkeyPatch) -> None:
    wait = StationEnd.wait

    def waited(end: StationEnd, until: float) -> None:
        if end.outcomes:
            os.kill(os.getpid(), signal.SIGTERM)
        wait(end, until)

    monkeypatch.setattr(StationEnd, "wait", waited)


def test_a_loop_of_nothing_ends(tmp_path, capsys):
    path = tmp_path / "beacons.pcap"
    path.write_bytes(capture.header() + capture.record(BEACON, 10**18))
    with FakeStation(answer=sent_by("g5")) as station:
        cli.main(["replay", str(path), *station.options, "--loop"])
    assert "0 sent of 1 read" in capsys.readouterr().err
