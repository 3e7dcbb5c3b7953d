"""Attacks by senders: only the attacker is ended, and each end is counted."""

from contextlib import suppress

import pytest

from drivers.reason import Reason
from firmware.endpoint.inlet import MAX_FRAME, MAX_FRAMES
from firmware.endpoint.peers.limits import (
    UNFINISHED,
)
from tests.cases.endpoint_bench import CAM, INLETS, PART, Bench, bench, is_cut_while_sending, push
from tests.hostile import OldPeer, frame

__all__ = ["bench"]  # a fixture


@INLETS
def test_a_message_that_does_not_end_ends_its_connection_alone(bench: Bench, kind: str) -> None:
    where = {"push": "pull", "pub": "from_users"}[kind]
    good, rude = bench.peer(kind), bench.peer(kind)
    push(good, 10)
    for _ in range(UNFINISHED // 60_000 + 2):
        rude.socket.sendall(PART)
    bench.until(lambda: bench.count(where, Reason.UNFINISHED) == 1)
    bench.until(rude.is_cut)
    push(good, 10)
    bench.until(lambda: bench.router.taken == 20)
    assert not good.is_cut()
    assert bench.router.refused == 0
    bench.until(lambda: bench.open() == 1)


@INLETS
def test_an_honest_sender_of_zmtp_2_loses_neither_its_connection_nor_a_message(bench: Bench, kind: str) -> None:
    good, idle = bench.peer(kind, OldPeer), bench.peer(kind)
    for _ in range(6):
        push(good, 1000)
        bench.loop.run_for(0.05)
    bench.until(lambda: bench.router.taken == 6_000)
    assert not good.is_cut()
    assert not idle.is_cut()


@INLETS
def test_a_message_of_zmtp_2_that_does_not_end_ends_its_connection(
    bench: Bench, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("firmware.endpoint.peers.guard.EXCUSED", 3 * UNFINISHED)
    where = {"push": "pull", "pub": "from_users"}[kind]
    good, rude = bench.peer(kind, OldPeer), bench.peer(kind, OldPeer)
    with suppress(OSError):  # the last parts may come too late
        for _ in range(3 * UNFINISHED // 60_000 + 4):
            rude.socket.sendall(PART)
            bench.router.taken = 0
            push(good, 1)
            bench.until(lambda: bench.router.taken == 1)
            bench.loop.run_for(0.02)
    bench.until(lambda: bench.count(where, Reason.UNFINISHED) == 1)
    bench.until(rude.is_cut)
    assert not good.is_cut()


@INLETS
def test_a_fast_honest_sender_loses_neither_its_connection_nor_a_message(bench: Bench, kind: str) -> None:
    rude, good = bench.peer(kind), bench.peer(kind)
    for _ in range(UNFINISHED // 60_000 + 2):
        rude.socket.sendall(PART)
    for _ in range(6):  # 2 MB: six times what an unfinished message may have
        push(good, 1000)
        bench.loop.run_for(0.05)
    bench.until(lambda: bench.router.taken == 6_000)
    bench.until(lambda: is_cut_while_sending(rude))
    assert not good.is_cut()


def test_the_longest_message_that_is_taken_ends_no_connection(bench: Bench) -> None:
    good = bench.peer("push")
    for _ in range(5):
        for more in (True, True, False):
            good.socket.sendall(frame(bytes(MAX_FRAME), more))
            bench.loop.run_for(5.0)
    bench.until(lambda: bench.router.refused == 5)
    assert not good.is_cut()


def test_a_peer_that_was_idle_for_days_and_answers_heartbeats_stays(bench: Bench) -> None:
    good = bench.peer("push")
    bench.until(lambda: bench.open() == 1)
    for _ in range(200):
        for _ in range(100):  # 2 kB in 100 s
            good.socket.sendall(b"\4\x12\4PING\0\0" + bytes(11))
        bench.until(lambda: bench.open() == 1)
        bench.loop.run_for(100.0)
    assert not good.is_cut()
    assert bench.count("pull", Reason.UNFINISHED) == 0


def test_a_message_of_too_many_frames_ends_its_connection_and_holds_up_nobody(bench: Bench) -> None:
    rude, good = bench.peer("push"), bench.peer("push")
    rude.socket.sendall(frame(b"v2x.cam.", more=True) + frame(CAM, more=True) + frame(b"", more=True) * 20_000)
    rude.send(b"")
    push(good, 10)
    bench.until(lambda: bench.router.taken == 11)
    assert bench.count("pull", Reason.UNFINISHED) == 1
    bench.until(rude.is_cut)
    assert not good.is_cut()


def test_a_message_of_as_many_frames_as_allowed_counts_by_its_first_two(bench: Bench) -> None:
    good = bench.peer("push")
    good.socket.sendall(frame(b"v2x.cam.", True) + frame(CAM, True) + frame(b"", True) * (MAX_FRAMES - 3) + frame(b""))
    push(good, 1)
    bench.until(lambda: bench.router.taken == 2)
    assert not good.is_cut()
