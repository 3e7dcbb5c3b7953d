"""captain record: frames into pcapng and pipes; messages to the user."""

import errno
import json
import os
import signal
import socket
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from firmware import cli
from tests.firmware.commands.fake import FakeControl, FakeStation
from tests.firmware.recorder.reported_frames import FRAME, message, read
from tests.said import tells

ROOT = Path(__file__).parents[3]


def test_frames_are_recorded_with_what_is_known_of_their_station(tmp_path, capsys):
    path = tmp_path / "a.pcapng"
    reports = [message(1, "g5", rssi_dbm=-71), message(2, "g5"), message(5, "g5")]
    with FakeStation(reports=reports) as station:
        assert cli.main(["record", "--pcapng", str(path), *station.options, "--count", "3"]) == 0
    found = read(path)
    assert [frame.lost for frame in found] == [0, 0, 2]
    assert found[0].recording["station"] == "fake"
    assert found[0].description == "its-g5 by udp"
    said = capsys.readouterr().err
    assert tells(said.splitlines()[0], "captain: ", "station", f" 127.0.0.1:{station.ports[3]}")
    assert said.endswith(f"captain: {path}: 3 frames, 2 lost\n")


@pytest.mark.parametrize(
    ("wish", "numbers"),
    [(["--type", "denm"], [2]), (["--type", "1"], [2]), (["--station-id", "7"], [3]), (["--type", "cam"], [1, 3, 4])],
)
def test_what_is_not_wanted_is_left_out_and_not_missing(tmp_path, capsys, wish, numbers):
    path = tmp_path / "a.pcapng"
    reports = [
        message(1), message(2, type="denm", message_id=1), message(3, station_id=7), message(4),
    ]  # fmt: skip
    with FakeStation(reports=reports) as station:
        command = ["record", "--pcapng", str(path), *station.options, *wish, "--count", str(len(numbers))]
        assert cli.main(command) == 0
    assert [frame.said["sequence"] for frame in read(path)] == numbers
    assert ", 0 lost" in capsys.readouterr().err


def test_a_duration_ends_it(tmp_path):
    with FakeStation(reports=[message()]) as station:
        assert cli.main(["record", "--pcapng", str(tmp_path / "a"), *station.options, "--duration", "0.3"]) == 0
    assert len(read(tmp_path / "a")) == 1


def test_a_pipe_is_read_by_tshark_while_it_comes():
    with FakeStation(reports=[message(1), message(2)]) as station:
        command = [sys.executable, "-m", "firmware", "record", "--pcapng", "-", *station.options, "--count", "2"]
        with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE) as recorder:
            shown = subprocess.run(
                ["tshark", "-n", "-l", "-r", "-", "-T", "fields", "-e", "frame.comment", "-e", "_ws.malformed"],
                check=True,
                stdin=recorder.stdout,
                capture_output=True,
                text=True,
                timeout=60,
            )
        assert recorder.returncode == 0
    assert shown.stdout.splitlines() == ["cam of station 1337; time locked +-1.2 us\t"] * 2


def test_live_what_wireshark_captures_from_is_a_recording_and_it_ends_with_wireshark(tmp_path, monkeypatch):
    # tshark captures as Wireshark does with these options: by dumpcap, from its standard input.
    (tmp_path / "wireshark").write_text(
        f'#!/bin/sh\ntest "$*" = "-k -i -" && exec tshark -n -l -i - -c 2 -T fields -e frame.interface_name '
        f"-e frame.comment -e _ws.malformed >{tmp_path}/shown\n"
    )
    (tmp_path / "wireshark").chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    with FakeStation(reports=[message(1), message(2)]) as station:
        assert cli.main(["record", "--live", *station.options]) == 0
    assert (tmp_path / "shown").read_text().splitlines() == ["air\tcam of station 1337; time locked +-1.2 us\t"] * 2


@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 0), (signal.SIGHUP, 0)])
def test_a_signal_leaves_the_file_whole(tmp_path, monkeypatch, number, status):
    monkeypatch.setattr("firmware.recorder.scribe.Scribe.add", lambda scribe, told: os.kill(os.getpid(), number))
    with FakeStation(reports=[message(1)]) as station:
        assert cli.main(["record", "--pcapng", str(tmp_path / "a"), *station.options]) == status
    assert read(tmp_path / "a") == []


def test_a_ring_keeps_what_an_operator_asks_for(tmp_path, monkeypatch):
    reports = [message(1), message(2)]
    with FakeStation(reports=reports) as station:
        timer = threading.Timer(0.2, lambda: os.kill(os.getpid(), signal.SIGUSR1))
        timer.start()
        command = ["record", "--ring", str(tmp_path), *station.options, "--duration", "0.8"]
        assert cli.main(command) == 0
        timer.join()
    (path,) = tmp_path.glob("kept-*-operator.pcapng")
    assert len(read(path)) == 2


@pytest.mark.parametrize(
    ("options", "status", "words"),
    [
        (["--pcapng", "{there}"], 2, "the file exists"),
        (["--pcapng", "{folder}/no/a.pcapng"], 1, "No such file or directory"),
        (["--ring", "{folder}/no"], 1, "not a folder"),
        (["--ring", "{there}"], 1, "not a folder"),
    ],
)
def test_what_cannot_be_written_is_told_with_a_remedy(tmp_path, capsys, options, status, words):
    (tmp_path / "there").write_text("mine")
    options = [one.format(folder=tmp_path, there=tmp_path / "there") for one in options]
    with FakeStation() as station:
        assert cli.main(["record", *options, *station.options]) == status
    assert words in capsys.readouterr().err
    assert (tmp_path / "there").read_text() == "mine"


def test_recording_to_a_disk_that_takes_nothing_fails_with_its_losses(tmp_path, monkeypatch, capsys):
    def full(segment):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("firmware.recorder.filing.Segment.store", full)
    path = tmp_path / "a"
    with FakeStation(reports=[message(1), message(2)]) as station:
        assert cli.main(["record", "--pcapng", str(path), *station.options, "--duration", "0.5"]) == 1
    said = capsys.readouterr().err
    assert tells(said, f"{path}: {os.strerror(errno.ENOSPC).lower()}; ", "lost")
    assert said.endswith(f"{path}: 0 frames, 2 lost\n")


@pytest.mark.parametrize(
    "option", [["--size", "5"], ["--age", "60"], ["--on", "denm"], ["--before", "0.5"], ["--after", "1"]]
)
def test_recording_to_a_file_with_an_option_of_a_ring_is_refused(tmp_path, option, capsys):
    assert cli.main(["record", "--pcapng", str(tmp_path / "a"), *option]) == 2
    assert tells(capsys.readouterr().err, f"captain: {' '.join(option)}: ", "ring")
    assert not (tmp_path / "a").exists()


def test_recording_without_a_station_leaves_no_file(tmp_path, capsys):
    assert cli.main(["record", "--pcapng", str(tmp_path / "a"), "--station", "127.0.0.1:9"]) == 1
    assert tells(capsys.readouterr().err, "no station ", " 127.0.0.1:12")
    assert not (tmp_path / "a").exists()


def test_recording_of_a_duration_without_a_station_fails(tmp_path, capsys):
    with socket.create_server(("127.0.0.1", 0)) as mute:
        at = ["--station", "127.0.0.1:9", "--report", str(mute.getsockname()[1])]
        assert cli.main(["record", "--pcapng", str(tmp_path / "a"), *at, "--duration", "0.3"]) == 1
    assert tells(capsys.readouterr().err, ": ", "no station ", "heard")
    assert not (tmp_path / "a").exists()


def test_without_wireshark_it_says_so(monkeypatch, capsys):
    monkeypatch.setenv("PATH", "/nowhere")
    assert cli.main(["record", "--live"]) == 1
    assert "wireshark: command not found" in capsys.readouterr().err


def test_a_station_is_told_to_keep_what_was(tmp_path, capsys):
    with FakeControl(tmp_path / "c", b'{"ok": true, "folder": "/data/ring"}\n') as control:
        assert cli.main(["record", "--trigger", "near miss", "--control", str(control.path)]) == 0
    asked = json.loads(control.lines[0])
    assert (asked["do"], asked["text"]) == ("record", "near miss")
    assert capsys.readouterr().out == "captain: the recorder keeps /data/ring/kept-*\n"


def test_recording_without_a_destination_is_refused(capsys):
    with pytest.raises(SystemExit):
        cli.main(["record"])
    assert tells(capsys.readouterr().err, "captain record: ", "--pcapng", "required")


def test_rubbish_of_a_station_is_passed_over(tmp_path):
    reports = [
        (b"frame.", b"x"),
        (b"frame.a.", b"{}", b""),
        (b"else", b"{}"),
        (b"time.", b"[]"),
        message(1, frame=FRAME),
    ]
    with FakeStation(reports=reports) as station:
        assert cli.main(["record", "--pcapng", str(tmp_path / "a"), *station.options, "--count", "1"]) == 0
    assert len(read(tmp_path / "a")) == 1
