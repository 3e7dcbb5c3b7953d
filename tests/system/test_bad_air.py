"""Garbage from the air: random octets, and frames cut at every octet."""

import random
from collections.abc import Iterator
from functools import partial
from typing import Any

import pytest

from tests.system.air import HEADERS, single_hop
from tests.system.conftest import Bench, Launcher

PDU = bytes.fromhex("02020000053900010203")
COUNT = 40_000
CHUNK = 500
HEADER_TYPE = 19  # offset of the header type in the frame


@pytest.mark.parametrize("framing", ["pdu", "btp", "ethernet"])
def test_40000_random_datagrams_leave_it_working_and_its_memory_flat(launch: Launcher, framing: str) -> None:
    bench = launch(framing)
    bench.user.sub.unsubscribe(b"")
    start = _accounted(bench.station.status())
    datagrams = _random_datagrams(single_hop(PDU) if framing == "ethernet" else PDU)
    memory = 0
    for sent in range(CHUNK, COUNT + 1, CHUNK):
        for _ in range(CHUNK):
            bench.air.throw(next(datagrams))
        status = bench.station.until(partial(_has_accounted, start + sent))
        if sent == COUNT // 2:  # by now, the tables of neighbours and duplicates are nearly full
            memory = status["memory_kb"]
    assert status["memory_kb"] < memory + 3000
    bench.user.sub.subscribe(b"")
    bench.user.join_receiving(bench.air)
    bench.user.hears_nothing_before_a_mark(bench.air)


def _random_datagrams(good: bytes) -> Iterator[bytes]:
    """Yield bad datagrams: random ones of 0 to 120 octets, and good ones with changed octets or a cut end."""
    chance = random.Random(1)
    while True:
        yield chance.randbytes(chance.randrange(121))
        spoilt = bytearray(good)
        for _ in range(chance.randrange(1, 5)):
            spoilt[chance.randrange(len(good))] = chance.randrange(256)
        if len(good) > HEADERS and spoilt[HEADER_TYPE] >> 4 == 1:
            continue  # by chance a beacon, which is neither delivered nor dropped
        yield bytes(spoilt[: chance.randrange(len(good) + 1)]) if chance.random() < 0.5 else bytes(spoilt)


def _has_accounted(count: int, status: dict[str, Any]) -> bool:
    return _accounted(status) == count


def _accounted(status: dict[str, Any]) -> int:
    """Return the number of datagrams that g5 has received or dropped with a reason."""
    dropped = sum(row["count"] for row in status["drops"] if row["where"] == "g5")
    return int(sum(status["interfaces"]["g5"]["received"].values()) + dropped)


def test_a_frame_cut_at_every_octet_is_dropped_with_a_reason(ethernet: Bench) -> None:
    frame = single_hop(PDU)
    for length in range(len(frame)):
        before = ethernet.station.drops()
        ethernet.air.throw(frame[:length])
        ethernet.user.hears_nothing_before_a_mark(ethernet.air)
        after = ethernet.station.drops()
        changed = {key: after[key] - before.get(key, 0) for key in after if after[key] != before.get(key, 0)}
        assert list(changed.values()) == [1], f"cut after {length}: {changed}"


def test_captured_frames_cut_at_every_octet_never_pass(ethernet: Bench, frames: dict[str, bytes]) -> None:
    for name in ("cam-shb", "cam-signed-digest"):
        for length in range(len(frames[name])):
            ethernet.air.throw(frames[name][:length])
    ethernet.user.hears_nothing_before_a_mark(ethernet.air)


def test_a_captured_frame_with_any_octet_of_its_headers_changed_harms_nothing(
    ethernet: Bench, frames: dict[str, bytes]
) -> None:
    good = frames["cam-shb"]
    for place in range(HEADERS):
        for value in (0x00, 0xFF, good[place] ^ 1, good[place] ^ 0x80):
            ethernet.air.throw(good[:place] + bytes((value,)) + good[place + 1 :])
    ethernet.air.throw(good[:-2] + b"zz")
    while ethernet.user.receive().pdu != good[HEADERS:-2] + b"zz":
        pass


@pytest.mark.parametrize("length", range(4))
def test_a_btp_header_cut_short_is_dropped_with_its_reason(btp: Bench, length: int) -> None:
    before = btp.station.drops().get(("g5", "truncated"), 0)
    btp.air.throw(b"\x07\xd1\0\0"[:length])
    btp.user.hears_nothing_before_a_mark(btp.air)
    assert btp.station.drops()["g5", "truncated"] == before + 1


@pytest.mark.parametrize("length", range(6))
@pytest.mark.parametrize("framing", ["pdu", "btp", "ethernet"])
def test_a_pdu_shorter_than_its_header_from_the_air_is_dropped_with_its_reason(
    framing: str, length: int, request: pytest.FixtureRequest
) -> None:
    bench: Bench = request.getfixturevalue(framing)
    reason = "short-pdu" if length else "empty-pdu"
    before = bench.station.drops().get(("g5", reason), 0)
    bench.air.send(PDU[:length])
    bench.user.hears_nothing_before_a_mark(bench.air)
    assert bench.station.drops()["g5", reason] == before + 1
