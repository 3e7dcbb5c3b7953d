"""Datagrams by recvmmsg(2), and what an intake does with them."""

import errno
import os
import socket

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.packet.datagrams import LONGEST, OUTCOME, SOCKADDR_IN, TIMESPEC, Room, sockaddr
from drivers.packet.intake import SO_TIMESTAMPNS, Intake


@pytest.fixture
def ends():
    with socket.socket(type=socket.SOCK_DGRAM) as near, socket.socket(type=socket.SOCK_DGRAM) as far:
        near.bind(("127.0.0.1", 0))
        near.setblocking(False)
        near.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
        far.connect(near.getsockname())
        yield near, far


def received(room, near):
    count = room.receive(near.fileno())
    outcomes = [OUTCOME.unpack_from(room.headers, place.outcome) for place in room.places[:count]]
    return [
        (room.memory[place.octets : place.octets + length], flags)
        for place, (flags, length) in zip(room.places, outcomes, strict=False)
    ]


ROOM = Room(8)


@given(messages=st.lists(st.binary(max_size=300), max_size=20))
def test_all_datagrams_arrive_in_their_order_as_many_at_once_as_there_is_room_for(ends, messages):
    near, far = ends
    for message in messages:
        far.send(message)
    found = []
    while portion := received(ROOM, near):
        assert len(portion) == min(8, len(messages) - len(found))
        found += portion
    assert found == [(message, 0) for message in messages]


def test_each_has_its_sender_and_the_time_of_its_arrival(ends):
    near, far = ends
    far.send(b"one")
    far.send(b"two")
    room = Room(3)
    assert room.receive(near.fileno()) == 2
    stamps = [TIMESPEC.unpack_from(room.memory, place.stamp) for place in room.places]
    names = [room.memory[place.name : place.name + SOCKADDR_IN.size] for place in room.places]
    assert 1_600_000_000 < stamps[0][0] < 5_000_000_000
    assert stamps[0] < stamps[1]
    assert names == [sockaddr(far.getsockname())] * 2 + [bytes(SOCKADDR_IN.size)]


@pytest.mark.parametrize("size", [0, 1, LONGEST - 1, LONGEST])
def test_what_fits_is_whole(ends, size):
    near, far = ends
    message = os.urandom(size)
    far.send(message)
    assert received(ROOM, near) == [(message, 0)]


@pytest.mark.parametrize("size", [LONGEST + 1, 65507])
def test_what_is_longer_is_cut_says_so_and_spoils_no_neighbour(ends, size):
    near, far = ends
    for message in (b"before", bytes(size), b"behind"):
        far.send(message)
    assert received(ROOM, near) == [(b"before", 0), (bytes(LONGEST), socket.MSG_TRUNC), (b"behind", 0)]


def test_an_empty_socket_gives_none(ends):
    assert ROOM.receive(ends[0].fileno()) == 0


def test_an_error_of_the_socket_is_raised_with_its_number(ends):
    near, far = ends
    near.close()
    far.setblocking(False)
    far.send(b"x")
    with pytest.raises(ConnectionRefusedError) as failure:
        ROOM.receive(far.fileno())
    assert failure.value.errno == errno.ECONNREFUSED
    assert ROOM.receive(far.fileno()) == 0


def test_a_closed_descriptor_is_an_error():
    with pytest.raises(OSError, match="descriptor"):
        ROOM.receive(-1)


@pytest.fixture
def intake(ends, host):
    failures = []
    intake = Intake(host, ends[0].dup(), host.indicate, failures.append)
    intake.failures = failures
    yield intake
    intake.close()


def test_what_is_kept_is_not_written_over_by_what_follows(loop, host, ends, intake):
    messages = [bytes([number]) * 50 for number in range(100)]
    for message in messages:
        ends[1].send(message)
    loop.run_until(lambda: host.count == 100)
    assert host.pdus == messages


def test_an_intake_that_is_closed_by_what_it_delivers_delivers_nothing_more(loop, host, ends, intake):
    host.on_indication = lambda: host.count == 3 and intake.close()
    for _ in range(8):
        ends[1].send(b"message")
    loop.run_for(1)
    assert host.count == 3
    assert intake.failures == []


def test_copies_of_own_datagrams_are_passed_over_and_not_counted(loop, host, ends, intake):
    intake.own = sockaddr(ends[1].getsockname())
    with socket.socket(type=socket.SOCK_DGRAM) as other:
        ends[1].send(b"ours")
        other.sendto(b"theirs", ends[0].getsockname())
        loop.run_until(lambda: host.total)
    assert (host.pdus, host.drops) == ([b"theirs"], {})


def test_what_the_socket_reports_is_told_once(loop, host, ends):
    near, far = ends
    near.close()
    failures = []
    intake = Intake(host, far.dup(), host.indicate, failures.append)
    far.send(b"x")
    loop.run_until(lambda: failures)
    loop.run_for(1)
    assert [failure.errno for failure in failures] == [errno.ECONNREFUSED]
    intake.close()


def test_the_urgent_lane_is_read_after_every_slice_of_the_others_together(loop, host, ends):
    lanes = []
    senders = []
    for _ in range(4):
        near = socket.socket(type=socket.SOCK_DGRAM)
        near.bind(("127.0.0.1", 0))
        lanes.append(Intake(host, near, host.indicate, pytest.fail, lanes[0] if lanes else None))
        senders.append(near.getsockname())
    for place in (1, 2, 3, 0):
        for _ in range(4):
            ends[1].connect(senders[place])
            ends[1].send(bytes([place]))
    loop.run_until(lambda: host.count == 16)
    assert b"".join(host.pdus) == bytes([1] * 4 + [2] * 4 + [0] * 4 + [3] * 4)
    for lane in lanes:
        lane.close()
