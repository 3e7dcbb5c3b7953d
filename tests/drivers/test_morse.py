"""Morse: two stations exchange PDUs as sound files or by a GPIO line."""

import wave
from itertools import pairwise
from pathlib import Path

import pytest

from board.machine import Machine
from board.runtime.describe import read
from board.runtime.errors import ConfigurationError, InterfaceError, RequestError
from drivers.contract import Can, Sent
from drivers.morse import KEEP, Morse, MorseOptions
from drivers.reason import Reason
from drivers.wire import morse
from tests.board.gpio import Gpio
from tests.drivers.host import CAM, DENM, SHARED, Host, request

PATIENCE_S = 0.0  # nothing here crosses the kernel's threads


@pytest.fixture
def start(host, tmp_path, at_end):
    shared = SHARED._replace(machine=Machine(dev=tmp_path))

    def start(host=host, **options):
        paths = {key: str(value) if isinstance(value, Path) else value for key, value in options.items()}
        driver = Morse(MorseOptions(**paths), shared)
        driver.start(host)
        at_end(driver.stop)
        return driver

    return start


def say(driver, host, pdu):
    """Send a PDU, and run the loop until it has been sent."""
    wanted = request(pdu)
    assert driver.send(wanted) is Sent.LATER
    host.loop.run_until(lambda: (wanted, None) in host.confirms)


def samples(pdu):
    return b"".join(morse.wav(morse.encode(pdu), 20))[44:]


def write(path, samples, channels=1, width=1):
    with wave.open(str(path), "wb") as file:
        file.setparams((channels, width, 8000, 0, "NONE", ""))
        file.writeframes(samples)


def test_two_stations_hear_each_other_through_a_directory(loop, host, start, tmp_path):
    other = Host(loop)
    driver = start(speak=tmp_path)
    start(other, listen=tmp_path)
    for pdu in (CAM, DENM):
        say(driver, host, pdu)
    loop.run_until(lambda: other.count == 2)
    assert other.pdus == [CAM, DENM]
    assert list(tmp_path.iterdir()) == []


def test_what_is_spoken_is_a_wav_file_that_players_play(host, start, tmp_path):
    say(start(speak=tmp_path), host, CAM)
    (path,) = tmp_path.iterdir()
    with wave.open(str(path)) as file:
        assert (file.getnchannels(), file.getsampwidth(), file.getframerate()) == (1, 1, 8000)
        assert file.readframes(10_000_000) == samples(CAM)


def test_what_nobody_listens_to_does_not_fill_the_disk(host, start, tmp_path):
    driver = start(speak=tmp_path)
    for number in range(KEEP + 5):
        say(driver, host, bytes([2, 2, number]))
    assert len(list(tmp_path.iterdir())) == KEEP


@pytest.mark.parametrize("octets", [b"", b"RIFF", b"no sound at all", bytes(1000)])
def test_a_file_that_is_no_message_is_named_and_removed(loop, host, start, tmp_path, octets):
    (tmp_path / "1.wav").write_bytes(octets)
    write(tmp_path / "2.wav", samples(CAM))
    start(listen=tmp_path)
    loop.run_until(lambda: host.indications)
    assert (host.pdus, host.drops) == ([CAM], {Reason.FRAMING: 1})
    assert list(tmp_path.iterdir()) == []


def test_stereo_is_not_understood_and_said_so(loop, host, start, tmp_path):
    write(tmp_path / "1.wav", samples(CAM), channels=2)
    start(listen=tmp_path)
    loop.run_until(lambda: host.total)
    assert host.drops == {Reason.FRAMING: 1}


def test_what_is_no_wav_file_is_left_alone(loop, host, start, tmp_path):
    (tmp_path / "directory.wav").mkdir()
    (tmp_path / "part").write_bytes(b"half")
    start(listen=tmp_path)
    loop.run_for(1)
    assert (host.total, len(list(tmp_path.iterdir()))) == (0, 2)


def test_a_directory_that_disappears_fails_the_interface(loop, host, start, tmp_path):
    directory = tmp_path / "air"
    directory.mkdir()
    driver = start(speak=directory, listen=directory)
    directory.rmdir()
    loop.run_until(lambda: host.failures)
    assert driver.send(request(CAM)) is Sent.BUSY
    assert str(host.failures[0]) == f"{directory}: No such file or directory"
    with pytest.raises(InterfaceError, match="no directory"):
        start(listen=directory)


@pytest.mark.parametrize(("options", "can"), [
    ({"listen": "."}, Can.RECEIVE), ({"speak": "."}, Can.TRANSMIT), ({"line": 0}, Can.TRANSMIT),
])  # fmt: skip
def test_it_declares_what_its_options_let_it_do(options, can):
    assert Morse(MorseOptions(**options), SHARED).capabilities.can == can


def test_a_long_message_is_written_in_slices_and_another_waits_until_it_is_there(loop, host, start, tmp_path):
    driver = start(speak=tmp_path, unit_ms=100)
    longest = CAM.ljust(morse.MAX_PDU, b"\0")
    wanted = request(longest)
    assert driver.send(wanted) is Sent.LATER
    assert driver.send(request(DENM)) is Sent.BUSY
    assert [path.name for path in tmp_path.iterdir()] == ["part"]
    loop.run_until(lambda: host.times_writable == 1)
    assert host.confirms == [(wanted, None)]
    assert max(map(len, morse.wav(morse.encode(longest), 100))) < 150_000


def test_a_message_that_is_half_written_at_a_stop_is_never_heard(loop, host, start, tmp_path):
    driver = start(speak=tmp_path)
    driver.send(request(CAM))
    driver.stop()
    loop.run_for(1)
    assert (host.confirms, list(tmp_path.glob("*.wav"))) == ([], [])
    driver.start(host)
    say(driver, host, CAM)


def test_a_pdu_that_takes_minutes_is_refused(start, tmp_path):
    driver = start(speak=tmp_path)
    with pytest.raises(RequestError, match="129"):
        driver.send(request(CAM.ljust(129, b"\0")))


@pytest.fixture
def chip(loop, monkeypatch, tmp_path):
    chip = Gpio(monkeypatch, tmp_path).add("gpiochip0", "pinctrl-bcm2711")
    chip.clock = loop.clock
    return chip


def test_a_line_blinks_the_message_and_the_request_is_confirmed_at_its_end(loop, host, start, chip):
    driver = start(line=17)
    wanted = request(CAM)
    assert driver.send(wanted) is Sent.LATER
    assert driver.send(request(DENM)) is Sent.BUSY
    loop.run_until(lambda: host.times_writable)
    assert host.confirms == [(wanted, None)]
    changes = chip.times[1:]  # the first makes it an output, inactive
    times = [when for when, _ in changes]
    assert [value for _, value in changes] == [True, False] * (len(times) // 2)
    durations = [later - sooner for sooner, later in pairwise(times)]
    assert morse.decode(durations) == CAM


def test_stopping_in_the_middle_of_a_message_leaves_the_line_inactive_and_free(loop, host, start, chip):
    driver = start(line=17)
    driver.send(request(CAM))
    loop.run_for(0.3)
    driver.stop()
    driver.stop()
    loop.run_for(60)
    assert chip.times[-1][1] is False
    assert chip.users == {}
    assert host.confirms == []


def test_a_line_that_is_not_there_is_said(start, chip, tmp_path):
    with pytest.raises(InterfaceError, match=f"{tmp_path}/gpiochip1, line 17: No such file"):
        start(line=17, chip="gpiochip1")


def test_a_line_that_disappears_fails_the_interface(loop, host, start, chip):
    driver = start(line=17)
    driver.send(request(CAM))
    chip.failure = OSError(19, "No such device")
    loop.run_until(lambda: host.failures)
    chip.failure = None


@pytest.mark.parametrize("table", [
    {}, {"line": "gpiochip0:17"}, {"line": -1}, {"chip": "gpiochip0"}, {"speak": ".", "unit_ms": 0},
])  # fmt: skip
def test_options_that_cannot_be_meant_are_refused(table):
    with pytest.raises(ConfigurationError):
        read(MorseOptions, table, "captain.toml")
