"""Corrections from a file or server reach the receiver complete, despite failures."""

import errno
import os
import socket
from itertools import pairwise

import pytest

from board.runtime.errors import ConfigurationError, InterfaceError
from board.time.scales import Carrier
from drivers.gnss.corrections import file, tcp
from drivers.gnss.corrections.attempts import SETTLED_S
from drivers.gnss.corrections.source import corrections
from drivers.gnss.options import GnssOptions
from drivers.gnss.port import SerialLine
from drivers.reason import Reason
from drivers.sim.receiver.navigation import RTK_FIXED_S
from drivers.wire import rtcm
from tests.drivers.gnss.receiver import Bench

# A station's place and its observations, as messages 1005, 1077, 1087, 1097 and 1230: numbers are real, contents are not.
ABSENT = os.strerror(errno.ENOENT).lower()
NUMBERS = (1005, 1077, 1087, 1097, 1230)
EPOCH = [rtcm.encode((number << 4).to_bytes(2) + bytes(40 + at)) for at, number in enumerate(NUMBERS)]


class Server:
    """NTRIP caster on the loopback for one client at a time."""

    def __init__(self):
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._listener.settimeout(2)
        self.client = None

    @property
    def url(self):
        return f"tcp://127.0.0.1:{self._listener.getsockname()[1]}"

    def accept(self):
        self.hang_up()
        self.client, _ = self._listener.accept()

    def hang_up(self):
        if self.client is not None:
            self.client.close()
            self.client = None

    def close(self):
        self.hang_up()
        self._listener.close()


@pytest.fixture
def server():
    made = Server()
    yield made
    made.close()


class Source:
    """Source of corrections, without a receiver."""

    def __init__(self, where, host):
        self.frames = []
        self.host = host
        self.source = corrections(where, host, self.frames.append)

    @property
    def details(self):
        return self.source.details()


def test_no_corrections_are_none(host):
    assert corrections("", host, print) is None


def test_a_file_is_replayed_and_what_is_appended_follows(loop, host, tmp_path):
    path = tmp_path / "base.rtcm3"
    path.write_bytes(b"".join(EPOCH))
    one = Source(str(path), host)
    loop.run_until(lambda: len(one.frames) == 5)
    assert one.frames == EPOCH
    with path.open("ab") as growing:
        growing.write(b"rubbish" + EPOCH[1])
    loop.run_until(lambda: len(one.frames) == 6)
    assert host.drops == {Reason.FRAMING: 1}
    assert one.details["frames"] == 6
    one.source.close()
    one.source.close()
    assert loop.delay() is None


def test_a_long_file_is_replayed_at_the_rate_of_a_line(loop, host, tmp_path):
    path = tmp_path / "base.rtcm3"
    path.write_bytes(b"".join(EPOCH) * 200)  # 54 kB
    one = Source(str(path), host)
    loop.run_for(5.1)
    assert 15_000 < sum(map(len, one.frames)) <= 20 * 1024
    one.source.close()


def test_a_pipe_without_a_writer_is_not_waited_for(loop, host, tmp_path):
    path = tmp_path / "pipe"
    os.mkfifo(path)
    one = Source(str(path), host)
    loop.run_for(1)
    with path.open("wb") as writer:
        writer.write(EPOCH[0])
        writer.flush()
        loop.run_until(lambda: one.frames)
    one.source.close()


def test_file_that_is_absent_is_logged_once_and_read_when_it_comes(loop, host, tmp_path, caplog):
    path = tmp_path / "base.rtcm3"
    one = Source(str(path), host)
    loop.run_for(3600)
    assert one.details["state"] == ABSENT
    assert caplog.text.count(f"base.rtcm3: {ABSENT}") == len(caplog.records) == 1
    path.write_bytes(EPOCH[0])
    loop.run_until(lambda: one.frames, within=61)
    assert one.details["state"] == "open"
    one.source.close()


@pytest.mark.parametrize("number", [errno.EIO, errno.ESTALE, errno.EISDIR])
def test_a_file_that_cannot_be_read_any_more_goes_on_where_it_was(loop, host, tmp_path, monkeypatch, caplog, number):
    path = tmp_path / "base.rtcm3"
    path.write_bytes(EPOCH[0])
    one = Source(str(path), host)
    loop.run_until(lambda: one.frames)

    def failing(*_):
        raise OSError(number, os.strerror(number))

    with monkeypatch.context() as broken:
        broken.setattr(file.os, "preadv", failing)
        loop.run_until(lambda: one.details["state"] == os.strerror(number).lower())
    with path.open("ab") as growing:
        growing.write(EPOCH[1])
    loop.run_until(lambda: len(one.frames) == 2)
    assert one.frames == EPOCH[:2]
    assert len(caplog.records) == 1
    one.source.close()


def test_a_file_that_is_on_its_way_from_the_disk_is_not_waited_for(loop, host, tmp_path, monkeypatch):
    path = tmp_path / "base.rtcm3"
    path.write_bytes(EPOCH[0])
    asked = []
    monkeypatch.setattr(file.os, "posix_fadvise", lambda *arguments: asked.append(arguments[1:3]))
    one = Source(str(path), host)
    with monkeypatch.context() as cold:
        cold.setattr(file.os, "preadv", blocking)
        loop.run_for(1)
    assert asked[0] == (0, 1024)
    assert one.frames == []
    loop.run_until(lambda: one.frames)
    one.source.close()


def blocking(*_):
    raise BlockingIOError(errno.EAGAIN, "")


def test_a_filesystem_that_cannot_say_whether_it_waits_is_read_all_the_same(loop, host, tmp_path, monkeypatch):
    def unable(*_):
        raise OSError(errno.EOPNOTSUPP, "")

    monkeypatch.setattr(file.os, "preadv", unable)
    path = tmp_path / "base.rtcm3"
    path.write_bytes(b"".join(EPOCH))
    one = Source(str(path), host)
    loop.run_until(lambda: len(one.frames) == 5)
    one.source.close()


def test_a_server_is_heard_in_any_cuts(loop, host, server):
    one = Source(server.url, host)
    server.accept()
    octets = b"".join(EPOCH)
    for at in range(0, len(octets), 7):
        server.client.sendall(octets[at : at + 7])
        loop.turn()
    loop.run_until(lambda: len(one.frames) == 5)
    assert one.frames == EPOCH
    assert one.details["state"] == "connected"
    one.source.close()
    assert loop.delay() is None


def test_a_damaged_frame_is_dropped_and_counted(loop, host, server):
    one = Source(server.url, host)
    server.accept()
    damaged = bytearray(EPOCH[1])
    damaged[9] ^= 4
    server.client.sendall(EPOCH[0] + damaged + EPOCH[2])
    loop.run_until(lambda: len(one.frames) == 2)
    assert one.frames == [EPOCH[0], EPOCH[2]]
    assert host.drops == {Reason.CHECKSUM: 1}
    one.source.close()


def test_a_server_that_hangs_up_after_each_frame_is_called_again_ever_later_and_said_seldom(loop, host, server, caplog):
    one = Source(server.url, host)
    times = []
    for _ in range(5):
        server.accept()
        times.append(loop.now)
        before = len(one.frames)
        server.client.sendall(EPOCH[0])
        loop.run_until(lambda before=before: len(one.frames) > before)
        server.hang_up()
        loop.run_until(lambda: "closed" in one.details["state"])
        loop.run_until(lambda: one.details["state"] != "not connected: the server closed the connection")
    assert [round(later - before) for before, later in pairwise(times)] == [1, 2, 4, 8]
    assert caplog.text.count("trying again") == 1
    one.source.close()


def test_a_server_that_was_well_for_a_while_is_called_again_at_once(loop, host, server):
    one = Source(server.url, host)
    for _ in range(4):
        server.accept()
        server.client.sendall(EPOCH[0])
        loop.run_for(SETTLED_S)
        server.hang_up()
        hung_up = loop.now
        loop.run_until(lambda: "closed" in one.details["state"])
        loop.run_until(lambda: one.details["state"] != "not connected: the server closed the connection")
        assert loop.now - hung_up < 1.5
    one.source.close()


def test_a_server_that_is_not_there_is_tried_less_and_less_often_and_said_once(loop, host, server, caplog):
    url = server.url
    server.close()
    one = Source(url, host)
    loop.patience_s = 0.0  # the loopback refuses at once
    loop.run_for(300)
    assert one.details["state"] == "not connected: connection refused"
    assert caplog.text.count("trying again") == 1
    one.source.close()


def test_what_sends_something_else_is_hung_up_on(loop, host, server):
    one = Source(server.url, host)
    server.accept()
    server.client.sendall(b"HTTP/1.1 200 OK\r\nContent-Type: text/html\r\n\r\n" + b"<html>" * 2000)
    loop.run_until(lambda: "not RTCM 3" in one.details["state"])
    assert host.drops.total() <= 20
    one.source.close()


def test_a_server_that_says_nothing_is_called_again(loop, host, server):
    one = Source(server.url, host)
    server.accept()
    loop.run_for(tcp.SILENT_S - 1)
    assert one.details["state"] == "connected"
    loop.run_for(1.5)
    assert "no RTCM for 60 s" in one.details["state"]
    one.source.close()


def test_closed_while_it_connects_it_leaves_nothing(loop, host, server):
    before = len(os.listdir("/proc/self/fd"))
    one = Source(server.url, host)
    one.source.close()
    one.source.close()
    assert len(os.listdir("/proc/self/fd")) == before
    loop.run_for(1)
    assert loop.delay() is None


def test_with_corrections_a_receiver_comes_to_a_fixed_solution_and_without_them_it_falls_back(loop, server):
    loop.patience_s = 0.01
    one = Bench(loop, corrections=server.url).up()
    server.accept()
    carriers = []
    for _ in range(round(RTK_FIXED_S) + 3):
        server.client.sendall(b"".join(EPOCH))
        loop.run_for(1)
        carriers.append(one.host.fixes[-1].carrier)
    assert sorted(set(carriers)) == list(Carrier)
    assert carriers == sorted(carriers)
    assert [frame.number for frame in one.receiver.heard][:5] == list(NUMBERS)
    told = one.details()
    assert told["carrier"] == "fixed"
    assert told["horizontal_mm"] == 14
    assert told["corrections"]["used"] >= 50
    assert told["corrections"]["age_s_below"] <= 2  # if octets are slow, the last one is a second old
    server.hang_up()
    loop.run_for(36)
    assert one.host.fixes[-1].carrier is Carrier.NONE
    assert one.details()["corrections"]["age_s_below"] is None
    one.close()


def test_file_that_is_absent_costs_no_position(loop, tmp_path):
    one = Bench(loop, corrections=str(tmp_path / "none")).up()
    assert one.details()["corrections"]["state"] == ABSENT
    one.close()
    assert loop.delay() is None


def test_a_receiver_that_fails_while_it_starts_leaves_no_corrections_behind(loop, server, monkeypatch):
    one = Bench(loop, corrections=server.url)
    before = len(os.listdir("/proc/self/fd"))
    monkeypatch.setattr(one.host, "fail", lambda error: one.driver.stop())
    with monkeypatch.context() as broken:
        broken.setattr(SerialLine, "write", lambda line, frame: line._broken(InterfaceError("input/output error")))
        one.start()
    assert len(os.listdir("/proc/self/fd")) == before
    one.start()
    one.driver.stop()
    assert len(os.listdir("/proc/self/fd")) == before
    one.close()
    assert loop.delay() is None


@pytest.mark.parametrize("scheme", ["ntrip", "http", "TCP"])
def test_a_source_of_another_kind_is_a_mistake_that_shows_no_password(scheme):
    with pytest.raises(ConfigurationError) as caught:
        GnssOptions(port="x", corrections=f"{scheme}://me:secret@192.0.2.1:2101/m")
    assert caught.value.message == f'corrections: "{scheme}://" is unsupported'
    assert "secret" not in str(caught.value)
