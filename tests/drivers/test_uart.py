"""Serial port: a pty with a simulated station at its other end."""

import os
import termios

import pytest

from board.runtime.describe import read
from board.runtime.errors import ConfigurationError, InterfaceError, RequestError
from drivers.contract import Sent
from drivers.reason import Reason
from drivers.sim.serial_line import SerialLine
from drivers.uart import Uart, UartOptions
from drivers.wire.serial_frame import Frame, encode
from tests.drivers.host import CAM, DENM, SHARED, request, told


@pytest.fixture
def line(loop):
    line = SerialLine(loop)
    yield line
    line.unplug()


@pytest.fixture
def deaf_line(loop):
    """Return a line whose other end reads nothing before listen(). The clock does not wait for octets in it."""
    loop.is_carrying = lambda: False
    line = SerialLine(loop, reads=False)
    yield line
    line.unplug()


@pytest.fixture
def start(host, at_end):

    def start(path, **options):
        driver = Uart(UartOptions(device=path, **options), SHARED)
        driver.start(host)
        at_end(driver.stop)
        return driver

    return start


def test_frames_cross_the_line_both_ways_with_their_ports(loop, host, line, start):
    driver = start(line.path)
    assert driver.send(request(DENM)) is Sent.NOW
    line.say(2001, CAM)
    line.say(0, CAM)
    told(loop, lambda: line.heard and host.count == 2)
    assert line.heard == [Frame(2002, DENM)]
    assert [(pdu, rx.btp_port) for pdu, _, rx in host.indications] == [(CAM, 2001), (CAM, None)]


def test_what_the_line_has_not_taken_is_thrown_away_at_a_stop_which_would_wait_for_it_otherwise(
    line, start, monkeypatch
):
    # A pty is never slow, so the test checks the call that discards octets, not its effect.
    thrown = []
    flush = termios.tcflush

    def tcflush(descriptor, queue):
        flush(descriptor, queue)  # fails if the port is already closed
        thrown.append(queue)

    driver = start(line.path)
    monkeypatch.setattr(termios, "tcflush", tcflush)
    driver.stop()
    assert termios.TCOFLUSH in thrown


@pytest.mark.parametrize("baud", [9600, 115_200])
def test_requests_wait_in_the_stations_queue_and_not_in_the_kernels(loop, host, line, start, baud):
    driver = start(line.path, baud=baud)
    pdu = CAM.ljust(300, b"\0")
    outcomes = [driver.send(request(pdu, number)) for number in range(20)]
    taken = outcomes.count(Sent.NOW)
    assert outcomes == [Sent.NOW] * taken + [Sent.BUSY] * (20 - taken)
    assert (taken - 1) * 310 * 10 / baud <= 0.02
    loop.run_until(lambda: host.times_writable == 1, within=taken * 310 * 10 / baud)
    assert driver.send(request(DENM)) is Sent.NOW


def test_a_line_that_takes_nothing_keeps_one_message_and_confirms_it_when_it_has_left(loop, host, deaf_line, start):
    driver = start(deaf_line.path, baud=4_000_000)
    pdu, sent = CAM.ljust(1500, b"\0"), []
    while not sent or sent[-1] is Sent.NOW:
        loop.run_for(0.01)
        sent.append(driver.send(request(pdu, len(sent))))
    assert sent[-1] is Sent.LATER
    assert driver.send(request(DENM, 99)) is Sent.BUSY
    assert host.confirms == []
    deaf_line.listen()
    told(loop, lambda: host.times_writable)
    assert [(asked.number, reason) for asked, reason in host.confirms] == [(len(sent) - 1, None)]
    told(loop, lambda: len(deaf_line.heard) == len(sent))
    assert deaf_line.heard == [Frame(2001, pdu)] * len(sent)


def test_garbage_and_damaged_frames_are_named_and_the_next_frame_passes(loop, host, line, start):
    start(line.path)
    line.say_octets(b"noise" + encode(2001, CAM)[:-1] + b"\xff" + encode(2002, DENM))
    told(loop, lambda: host.indications)
    line.say_octets(b"half of a frame: " + encode(2001, CAM)[:9])
    told(loop, lambda: host.drops.total() == 2, patience_s=0.3)
    assert host.pdus == [DENM]
    assert host.drops == {Reason.CHECKSUM: 1, Reason.FRAMING: 1}
    assert host.samples[0].startswith(b"noise")


def test_an_unplugged_port_fails_the_interface_and_serves_when_it_is_back(loop, host, line, start):
    driver = start(line.path)
    line.unplug()
    told(loop, lambda: host.failures)
    assert str(host.failures[0]).startswith(f"{line.path} is gone")
    driver.stop()
    with pytest.raises(InterfaceError, match="no such file or directory"):
        driver.start(host)
    again = SerialLine(loop)
    back = start(again.path)
    back.send(request(CAM))
    told(loop, lambda: again.heard)
    again.unplug()


def test_a_port_that_breaks_while_a_message_waits_keeps_the_loop_clean(loop, host, deaf_line, start):
    driver = start(deaf_line.path, baud=4_000_000)
    outcome = Sent.NOW
    while outcome is Sent.NOW:
        loop.run_for(0.01)
        outcome = driver.send(request(CAM.ljust(1500, b"\0")))
    deaf_line.unplug()
    told(loop, lambda: host.failures)
    driver.stop()
    loop.run_for(1)
    assert (len(host.failures), host.confirms) == (1, [])


def test_a_port_that_breaks_at_a_send_takes_no_request(host, line, start):
    driver = start(line.path)
    line.unplug()
    assert driver.send(request(CAM)) is Sent.BUSY
    assert len(host.failures) == 1


def test_a_port_that_is_taken_is_said(line, start):
    start(line.path)
    with pytest.raises(InterfaceError, match="is in use by another program"):
        start(line.path)


def test_what_is_no_serial_port_is_refused(start, tmp_path):
    file = tmp_path / "file"
    file.write_bytes(b"")
    before = os.listdir("/proc/self/fd")
    with pytest.raises(InterfaceError, match="file: "):
        start(str(file))
    assert os.listdir("/proc/self/fd") == before


def test_a_pdu_that_fits_no_frame_is_the_users_fault(line, start):
    driver = start(line.path)
    with pytest.raises(RequestError):
        driver.send(request(CAM + bytes(1500)))
    assert driver.send(request(CAM)) is Sent.NOW


@pytest.mark.parametrize(
    "table", [{}, {"device": "/dev/ttyUSB0", "baud": 0}, {"device": "/dev/ttyUSB0", "bauds": 9600}]
)
def test_options_that_cannot_be_meant_are_refused(table):
    with pytest.raises(ConfigurationError):
        read(UartOptions, table, "captain.toml")
