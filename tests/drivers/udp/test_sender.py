"""Full sockets, tested with AF_UNIX pairs: unlike UDP on loopback, these can be full."""

import errno
import socket

import pytest

from board.runtime.address import Address
from board.runtime.errors import RequestError
from drivers.contract import Sent
from drivers.reason import Reason
from drivers.udp.sender import Sender, Target
from tests.drivers.host import CAM, DENM, request


class Line:
    """Target whose socket is full until it is read, or fails as the test demands."""

    def __init__(self, port):
        self.far, near = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
        self.target = Target(Address("127.0.0.1", port), near)

    def read(self):
        octets = []
        try:
            while True:
                octets.append(self.far.recv(70000))
        except BlockingIOError:
            return octets

    def fill(self):
        count = 0
        try:
            while True:
                self.target.socket.send(b"fill")
                count += 1
        except BlockingIOError:
            return count


class Failing:
    """Socket that first raises errors, and then works."""

    def __init__(self, *errors):
        self.errors = list(errors)
        self.sent = []

    def send(self, octets):
        if self.errors:
            code = self.errors.pop(0)
            raise OSError(code, errno.errorcode[code])
        self.sent.append(octets)

    def setsockopt(self, level, option, value): ...

    def close(self): ...


@pytest.fixture
def lines():
    lines = [Line(1), Line(2)]
    yield lines
    for line in lines:
        line.far.close()


@pytest.fixture
def sender(host, lines):
    sender = Sender(host, [line.target for line in lines], absent=lambda to: None)
    yield sender
    sender.close()


def failing(host, *errors, absent=lambda to: None):
    taker = Failing(*errors)
    return Sender(host, [Target(Address("127.0.0.1", 9), taker)], absent), taker


def test_a_full_first_target_takes_nothing_and_says_when_it_does(loop, host, lines, sender):
    lines[0].fill()
    assert sender.send(CAM, request(CAM)) is Sent.BUSY
    assert sender.send(DENM, request(DENM)) is Sent.BUSY
    assert lines[1].read() == []
    lines[0].read()
    loop.run_until(lambda: host.times_writable == 1)
    assert sender.send(DENM, request(DENM)) is Sent.NOW
    assert [line.read() for line in lines] == [[DENM], [DENM]]
    assert host.confirms == []


def test_a_full_second_target_gets_the_message_later_and_only_once(loop, host, lines, sender):
    lines[1].fill()
    wanted = request(CAM)
    assert sender.send(CAM, wanted) is Sent.LATER
    assert sender.send(DENM, request(DENM)) is Sent.BUSY
    lines[1].read()
    loop.run_until(lambda: host.times_writable == 1)
    assert host.confirms == [(wanted, None)]
    assert [line.read() for line in lines] == [[CAM], [CAM]]


def test_closing_while_full_leaves_nothing_on_the_loop(loop, host, lines, sender):
    lines[0].fill()
    sender.send(CAM, request(CAM))
    sender.close()
    sender.close()
    lines[0].far.close()
    loop.run_for(1)
    assert host.times_writable == 0


def test_a_device_without_room_is_asked_again_after_a_moment(loop, host):
    sender, taker = failing(host, errno.ENOBUFS)
    assert sender.send(CAM, request(CAM)) is Sent.BUSY
    loop.run_until(lambda: host.times_writable == 1, within=0.1)
    assert sender.send(CAM, request(CAM)) is Sent.NOW
    assert taker.sent == [CAM]


def test_closing_before_the_moment_is_over_cancels_it(loop, host):
    sender, _ = failing(host, errno.ENOBUFS)
    sender.send(CAM, request(CAM))
    sender.close()
    loop.run_for(1)
    assert host.times_writable == 0


@pytest.mark.parametrize("times", [1, 2, 3])
def test_a_refusal_is_about_an_earlier_datagram_and_this_one_is_sent_again(host, times):
    told = []
    sender, taker = failing(host, *[errno.ECONNREFUSED] * times, absent=told.append)
    assert sender.send(CAM, request(CAM)) is Sent.NOW
    assert told == [Address("127.0.0.1", 9)]
    assert taker.sent == ([CAM] if times < 3 else [])


def test_an_absent_peer_does_not_keep_a_message_from_the_next_one(host):
    told = []
    gone, taker = Failing(*[errno.EHOSTUNREACH] * 9), Failing()
    targets = [Target(Address("127.0.0.1", port), one) for port, one in ((8, gone), (9, taker))]
    assert Sender(host, targets, told.append).send(CAM, request(CAM)) is Sent.NOW
    assert (told, taker.sent) == ([Address("127.0.0.1", 8)], [CAM])


def test_a_peer_that_is_absent_when_its_socket_has_room_again_is_told_and_the_message_confirmed(loop, host):
    told = []
    late, last = Failing(errno.ENOBUFS, *[errno.ECONNREFUSED] * 9), Failing()
    targets = [Target(Address("127.0.0.1", port), one) for port, one in ((7, Failing()), (8, late), (9, last))]
    wanted = request(CAM)
    assert Sender(host, targets, told.append).send(CAM, wanted) is Sent.LATER
    loop.run_until(lambda: host.times_writable == 1)
    assert (told, last.sent, host.confirms) == ([Address("127.0.0.1", 8)], [CAM], [(wanted, None)])


def test_what_turns_out_to_be_too_long_for_a_later_target_is_dropped_and_the_next_one_sent(loop, host):
    taker = Failing(errno.ENOBUFS, errno.EMSGSIZE)
    targets = [Target(Address("127.0.0.1", port), one) for port, one in ((8, Failing()), (9, taker))]
    sender, wanted = Sender(host, targets, lambda to: None), request(CAM)
    assert sender.send(CAM, wanted) is Sent.LATER
    loop.run_until(lambda: host.times_writable == 1)
    assert host.confirms == [(wanted, Reason.LONG_PDU)]
    assert sender.send(DENM, request(DENM)) is Sent.NOW
    assert taker.sent == [DENM]


def test_what_is_too_long_for_a_datagram_is_the_users_fault(host):
    sender, taker = failing(host, errno.EMSGSIZE)
    with pytest.raises(RequestError, match="too long"):
        sender.send(CAM, request(CAM))
    assert sender.send(DENM, request(DENM)) is Sent.NOW
    assert taker.sent == [DENM]


@pytest.mark.parametrize("code", [errno.ENETDOWN, errno.ENODEV, errno.EADDRNOTAVAIL, errno.ENETUNREACH, errno.EPERM])
def test_a_lost_device_fails_the_interface_and_keeps_the_request(host, code):
    sender, _ = failing(host, code)
    assert sender.send(CAM, request(CAM)) is Sent.BUSY
    assert [str(failure).partition(": ")[0] for failure in host.failures] == ["sending to 127.0.0.1:9"]
    assert host.drops == {}
