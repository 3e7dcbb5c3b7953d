"""Attacks by many connections and by slow subscribers, and the descriptors that connections need."""

import errno
import os
import resource
import socket
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
import zmq

from drivers.reason import Reason
from firmware.endpoint.peers.limits import (
    DESCRIPTORS,
    QUEUE,
    WAITING,
    most_connections,
    raise_descriptors,
)
from firmware.endpoint.report import memory_kb
from image import own_files
from tests.cases.endpoint_bench import CAM, Bench, bench, push

__all__ = ["bench"]  # a fixture


def test_of_too_many_connections_the_oldest_unused_one_is_ended(bench: Bench) -> None:
    bench.guard.most = 8
    good = bench.peer("push")
    push(good, 1)
    bench.until(lambda: bench.router.taken == 1)
    idle = [bench.peer("push") for _ in range(8)]
    bench.until(idle[0].is_cut)
    late = bench.peer()
    late.subscribe(b"v2x.")
    bench.until(lambda: bench.wanted == {b"v2x.": True})
    bench.until(idle[1].is_cut)
    assert not any(one.is_cut() for one in (good, late, *idle[2:]))
    assert bench.count("pull", Reason.CONNECTIONS) == 2
    bench.until(lambda: bench.open() == 8)


def test_descriptors_of_connections_that_end_are_released(bench: Bench) -> None:
    before = len(os.listdir("/proc/self/fd"))
    peers = [bench.peer(kind) for kind in ("sub", "push", "pub") for _ in range(10)]
    bench.until(lambda: bench.open() == 30)
    for peer in peers:
        peer.close()
    bench.until(lambda: bench.open() == 0)
    bench.until(lambda: len(os.listdir("/proc/self/fd")) <= before)


def test_of_subscribers_that_do_not_read_the_slowest_are_ended_and_counted(bench: Bench) -> None:
    bench.loop.patience_s = 0.0
    slow = []
    for _ in range(6):
        peer = bench.peer()
        peer.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        peer.subscribe(b"")
        slow.append(peer)
    good = bench.peer()
    good.subscribe(b"v2x.")
    bench.until(lambda: bench.publisher._interest.total == 7)
    bench.loop.patience_s = 0.0
    read = b""
    for number in range(40):
        for _ in range(QUEUE // 16):
            bench.publisher.publish(b"v2x.cam.", CAM)
        bench.loop.run_for(0.05)
        read += good.read()
        assert number < 39 or bench.count("to_users", Reason.SUBSCRIBER_CUT)
        if bench.count("to_users", Reason.SUBSCRIBER_CUT):
            break
    cut = bench.count("to_users", Reason.SUBSCRIBER_CUT)
    assert 1 <= cut <= 3
    bench.until(lambda: sum(one.is_ended() for one in slow) == cut)
    assert not good.is_cut()
    waiting = sum(QUEUE for one in bench.publisher.door.connections.values() if one.blocked_at is not None)
    assert waiting <= WAITING + QUEUE


@contextmanager
def descriptors(most: int) -> Iterator[None]:
    """A soft limit of descriptors."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (most, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


def test_memory_is_0_where_descriptors_are_used_up() -> None:
    assert memory_kb() > 0
    with descriptors(1):
        used_up = memory_kb()
    assert used_up == 0


def test_the_limit_of_descriptors_is_raised_and_leaves_room_for_what_is_no_connection() -> None:
    hard = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    with descriptors(1024):
        assert most_connections() == (1024 - 256) // 2
        raise_descriptors()
        assert resource.getrlimit(resource.RLIMIT_NOFILE) == (min(hard, 16_384), hard)
    with descriptors(512):
        assert most_connections() == 128


@pytest.mark.parametrize("form", [own_files.CARD, own_files.PACKAGE])
def test_a_unit_gives_the_station_as_many_descriptors_as_it_asks_for(form: str) -> None:
    assert f"\nLimitNOFILE={DESCRIPTORS}\n" in own_files.read("usr/lib/systemd/system/captain.service", form)


def test_sockets_of_the_endpoint_have_heartbeats(bench: Bench) -> None:
    for one in (*bench.inlets.values(), bench.publisher):
        assert (one._socket.get(zmq.HEARTBEAT_IVL), one._socket.get(zmq.HEARTBEAT_TIMEOUT)) == (10_000, 30_000)


def test_a_connection_for_which_there_is_no_descriptor_is_counted_and_ends_nothing(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(descriptor: int) -> int:
        raise OSError(errno.EMFILE, "Too many open files")

    monkeypatch.setattr("firmware.endpoint.peers.connection.os.dup", refuse)
    peer = bench.peer("push")
    push(peer, 5)
    bench.until(lambda: bench.router.taken == 5)
    bench.loop.run_for(2.0)
    peer.close()
    bench.until(lambda: bench.open() == 0)
