"""captain record: from a station's messages to a file."""

import errno
import math
import os
import signal
import struct
from pathlib import Path

import captain_messages
import pytest

from drivers.message import Position, RxInfo
from drivers.wire import raw
from firmware import cli
from firmware.client import client
from firmware.client.received import Message
from firmware.commands import record
from firmware.lab.laboratory import vectors
from firmware.recorder import mcap_recording
from firmware.recordings import reception
from firmware.recordings.mcap import Mcap
from tests.firmware.client.mcap_file import read
from tests.firmware.commands.fake import FakeStation
from tests.said import tells

CAM = next(one.pdu for one in vectors() if len(one.pdu) == 41)
NS = 1795182426_461613000
RX = RxInfo(rssi_dbm=-71, position=Position(470585000, 154600000), source_mac=bytes.fromhex("010203040506"))
LOCAL = (NS - 1_000_000, Position(470000000, -20000000))

CASES = Path(__file__).parents[2] / "cases"


def on_air(kind, pdu):
    return [(b"raw.", raw.build(pdu, NS, RX, LOCAL)), (b"v2x.%s." % kind.encode(), pdu)]


def recorded(path, *messages):
    with FakeStation([frames for one in messages for frames in on_air(*one)]) as station:
        status = cli.main(["record", "--mcap", str(path), *station.options, "--count", str(len(messages))])
    return status, read(path.read_bytes())


def test_a_message_is_recorded_as_that_of_ros_2_with_what_is_known_of_it_beside(tmp_path, capsys):
    status, found = recorded(tmp_path / "a.mcap", ("cam", CAM))
    assert status == 0
    assert [topic for topic, _, _ in found.channels.values()] == ["cam/received", "cam/received/metadata"]
    assert [name for name, _, _ in found.schemas.values()] == ["etsi_its_cam_msgs/msg/CAM", reception.TYPE]
    (_, ns, cdr), (_, same, metadata) = found.messages
    assert ns == same == NS // 1000 * 1000
    assert struct.unpack_from("<BBI", cdr, 4)[:2] == (CAM[0], CAM[1])
    assert metadata.endswith(CAM)
    assert "1 cam-1.4.1" in capsys.readouterr().err


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EIO])
def test_a_disk_that_takes_no_more_is_named_with_what_was_recorded(tmp_path, capsys, monkeypatch, number):
    def flush(mcap: Mcap) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr("firmware.recordings.mcap.CHUNK_OCTETS", 1)
    monkeypatch.setattr(Mcap, "flush", flush)
    path = tmp_path / "a.mcap"
    with FakeStation(on_air("cam", CAM)) as station:
        assert cli.main(["record", "--mcap", str(path), *station.options, "--count", "1"]) == 1
    told = capsys.readouterr().err
    assert f"captain: {path}: 1 cam-1.4.1" in told
    assert f"captain: {path}: {os.strerror(number)}\n" in told
    assert "mcap recover" in told


def test_no_topic_says_a_quality_of_service_that_rosbag2_would_not_read(tmp_path):
    path = tmp_path / "a.mcap"
    recorded(path, ("cam", CAM))
    offered = path.read_bytes().split(b"offered_qos_profiles")[1:]
    assert len(offered) == 4  # two topics, each in its chunk and in the summary
    assert {one[:4] for one in offered} == {bytes(4)}


def test_message_of_no_edition_is_recorded_as_octets(tmp_path, capsys):
    _, found = recorded(tmp_path / "a.mcap", ("cam", b"\2\2\0\0\0\7\xff"))
    assert [topic for topic, _, _ in found.channels.values()] == ["cam/received/metadata"]
    assert found.messages[0][2].endswith(b"\2\2\0\0\0\7\xff")
    assert tells(capsys.readouterr().err, "1 cam ", "no edition", "octets")


def test_a_station_that_makes_types_up_gets_a_topic_for_the_rest(tmp_path, monkeypatch):
    monkeypatch.setattr(mcap_recording, "MOST_NAMES", 2)
    _, found = recorded(tmp_path / "a.mcap", *[(kind, b"\0\0") for kind in ("a b", "c", "d", "c")])
    assert [topic for topic, _, _ in found.channels.values()] == [
        "a_b/received/metadata", "c/received/metadata", "others/received/metadata",
    ]  # fmt: skip
    assert [channel for channel, _, _ in found.messages] == [1, 2, 3, 2]


def test_doubts_beyond_a_number_are_counted_together(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(mcap_recording, "MOST_NAMES", 2)
    recorded(tmp_path / "a.mcap", *[("cam", bytes([version]) + CAM[1:]) for version in (7, 8, 9, 10, 8)])
    told = capsys.readouterr().err
    assert tells(told, "1 doubtful cam-1.4.1: ", "protocolVersion 7")
    assert tells(told, "2 doubtful cam-1.4.1: ", "protocolVersion 8")
    assert "2 doubtful others" in told
    assert "protocolVersion 9" not in told


def test_what_is_too_short_for_a_header_is_recorded(tmp_path):
    _, found = recorded(tmp_path / "a.mcap", ("a", b"\2"))
    assert found.messages[0][2].endswith(b"\1\0\0\0\2")


def test_a_reception_before_1970_is_at_its_beginning(tmp_path, monkeypatch):
    monkeypatch.setattr("tests.firmware.commands.test_record.NS", -5_000_000_000)
    _, found = recorded(tmp_path / "a.mcap", ("cam", CAM))
    assert {ns for _, ns, _ in found.messages} == {0}


def test_another_edition_than_the_preferred_one_has_a_topic_of_its_own():
    names = mcap_recording.topic_names(captain_messages)
    preferred = captain_messages.find("vam").name
    assert names[preferred] == "vam"
    assert {names[name] for name in names if name.startswith("vam-") and name != preferred} <= {
        "vam_1", "vam_2_1_1", "vam_2_3_1",
    }  # fmt: skip
    forms = [message.name for message in captain_messages.all() if message.form_of]
    assert len(set(names.values())) == len(names) - len(forms)


def test_both_forms_of_a_message_are_recorded_on_one_topic_and_told_apart(tmp_path):
    form = bytes.fromhex((CASES / "cpm-extension-bit.hex").read_text().splitlines()[2])
    strict = captain_messages.find("cpm-2.1.1").encode(captain_messages.find("cpm-2.1.1-ext").decode(form))
    _, found = recorded(tmp_path / "a.mcap", ("cpm", form), ("cpm", strict))
    assert [topic for topic, _, _ in found.channels.values()] == ["cpm/received", "cpm/received/metadata"]
    first, of_form, second, of_strict = (octets for _, _, octets in found.messages)
    assert first == second
    assert (b"cpm-2.1.1-ext\0" in of_form, b"cpm-2.1.1\0" in of_strict) == (True, True)


def test_of_no_station_nothing_is_left_but_what_was_there(tmp_path, monkeypatch, capsysbinary):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "-").write_bytes(b"mine")
    for name in ("-", "a.mcap"):
        assert cli.main(["record", "--mcap", name, "--station", "127.0.0.1:1"]) == 1
    assert [(path.name, path.read_bytes()) for path in tmp_path.iterdir()] == [("-", b"mine")]


def test_a_file_that_is_there_is_left_alone(tmp_path, capsys):
    path = tmp_path / "a.mcap"
    path.write_bytes(b"mine")
    assert cli.main(["record", "--mcap", str(path)]) == cli.USAGE_ERROR
    assert path.read_bytes() == b"mine"
    assert "the file exists" in capsys.readouterr().err


def test_recording_into_an_absent_folder_is_refused(tmp_path, capsys):
    assert cli.main(["record", "--mcap", str(tmp_path / "no" / "a.mcap")]) == 1
    assert f"no/a.mcap: {os.strerror(errno.ENOENT)}" in capsys.readouterr().err


class Interrupted:
    """A stream whose write number `at` is interrupted by a signal when half of it is done."""

    def __init__(self, stream, at, number):
        self._stream, self._left, self._number = stream, at, number

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._stream.close()

    def flush(self):
        self._stream.flush()

    def write(self, octets):
        half = len(octets) // 2
        self._stream.write(octets[:half])
        if self._left == 0:
            signal.raise_signal(self._number)
        self._left -= 1
        self._stream.write(octets[half:])


@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 0)])
@pytest.mark.parametrize("at", range(15))
def test_a_signal_in_the_midst_of_any_write_leaves_the_file_whole(tmp_path, monkeypatch, at, number, status):
    path = tmp_path / "a.mcap"
    monkeypatch.setattr(record, "_created", lambda path: Interrupted(path.open("xb"), at, number))
    monkeypatch.setattr("firmware.recordings.mcap.CHUNK_OCTETS", 1)  # so that each message is written at once
    monkeypatch.setattr(
        "firmware.client.listening.REDRAW_S", 60.0
    )  # however late the first comes, nothing else is done
    before = signal.getsignal(number)
    with FakeStation([frames for _ in range(3) for frames in on_air("cam", CAM)]) as station:
        ended = cli.main(["record", "--mcap", str(path), *station.options, "--count", "3"])
    assert ended == status
    assert len(read(path.read_bytes()).messages) in (2, 4, 6)
    assert signal.getsignal(number) is before


@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 0)])
def test_a_signal_while_nothing_comes_ends_it(tmp_path, monkeypatch, number, status):
    monkeypatch.setattr("firmware.client.listening.REDRAW_S", 0.01)
    monkeypatch.setattr(record.Recording, "idle", lambda recording: signal.raise_signal(number))
    with FakeStation() as station:
        ended = cli.main(["record", "--mcap", str(tmp_path / "a.mcap"), *station.options])
    assert ended == status
    assert read((tmp_path / "a.mcap").read_bytes()).messages == []


def test_what_is_known_of_a_reception_stands_where_the_definition_says():
    message = Message("cam", CAM, raw.parse(raw.build(CAM, NS, RX, LOCAL)))
    cdr = reception.cdr(message, NS, 3, "cam-1.4.1")[4:]
    assert struct.unpack_from("<iII", cdr) == (1795182426, 461613000, 8)
    assert struct.unpack_from("<Qi", cdr, 24) == (3, 1795182426)
    assert struct.unpack_from("<dddd", cdr, 48) == (47.0, -2.0, 47.0585, 15.46)
    assert struct.unpack_from("<IHh", cdr, 80) == (int.from_bytes(CAM[2:6]), 0, -71)
    assert cdr.endswith(struct.pack("<I", len(CAM)) + CAM)


def test_what_is_not_known_of_a_place_is_no_number():
    cdr = reception.cdr(Message("cam", CAM, None), NS, 1, "cam-1.4.1")[4:]
    assert all(math.isnan(one) for one in struct.unpack_from("<dddd", cdr, 48))


def test_without_a_station_no_file_is_left(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(client, "ANSWER_S", 0.1)
    assert cli.main(["record", "--mcap", str(tmp_path / "a"), "--station", "127.0.0.1:9"]) == 1
    assert not (tmp_path / "a").exists()
    with FakeStation() as station:
        station.is_silent = True
        assert cli.main(["record", "--mcap", str(tmp_path / "a"), *station.options]) == 1
    assert "no heartbeat" in capsys.readouterr().err
    assert not (tmp_path / "a").exists()


def test_a_hyphen_is_standard_output(tmp_path, capsysbinary, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with FakeStation(on_air("cam", CAM)) as station:
        assert cli.main(["record", "--mcap", "-", *station.options, "--count", "1"]) == 0
    assert len(read(capsysbinary.readouterr().out).messages) == 2
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("form", ["--mcap", "--pcapng"])
def test_a_standard_output_that_is_closed_takes_no_recording(form, monkeypatch, capsys):
    monkeypatch.setattr("sys.__stdout__", None)
    with FakeStation(on_air("cam", CAM)) as station:
        assert cli.main(["record", form, "-", *station.options, "--count", "1"]) == 2
    assert "standard output: closed" in capsys.readouterr().err


def test_station_that_falls_silent_is_reported_and_that_it_is_back(capsys):
    class Heard:
        silent_s = 0.0

    silence = record.Silence(Heard())
    for Heard.silent_s in (0.0, 3.5, 4.0, 0.0, 0.0):
        silence.tell()
    is_silent, is_back = capsys.readouterr().err.splitlines()
    assert tells(is_silent, "captain: ", "station", "silent")
    assert tells(is_back, "captain: ", "station", "heard again", "4 s")
