"""Probes: sent at a pace, reflected once each, nothing else."""

import json
from collections.abc import Iterator

import pytest

from board.runtime.errors import StationError
from firmware.client import client
from firmware.client.received import Message
from firmware.codec.library import load
from firmware.endpoint.report import digest_of
from firmware.meter.probe import Probes
from firmware.meter.prober import ECHO_S, Prober, Reflector, Trip
from firmware.meter.watch.station import LABEL

S = 1_000_000_000


class FakePusher:
    """A PUSH socket that may be full."""

    def __init__(self) -> None:
        self.sent: list[list[bytes]] = []
        self.is_full = False

    def poll(self, timeout: float, flags: int) -> int:
        return not self.is_full

    def send_multipart(self, frames: list[bytes], flags: int) -> None:
        self.sent.append(frames)


@pytest.fixture
def pusher(monkeypatch: pytest.MonkeyPatch) -> Iterator[FakePusher]:
    made = FakePusher()
    monkeypatch.setattr(client, "push", lambda context, place: made)
    return made


def probes() -> Probes:
    return Probes(load(), "cam", None, lambda: 1_795_182_426.0)


def prober(rate: float = 10.0, most: int | None = None) -> Prober:
    return Prober("A", None, client.Address(), probes(), rate=rate, most=most, options={"interfaces": ["g5"]})  # type: ignore[arg-type]


def message(pdu: bytes) -> Message:
    return Message("cam", pdu, None)


def test_probes_follow_each_other_at_their_pace(pusher: FakePusher) -> None:
    made = prober(rate=10.0, most=3)
    for turn in range(3):
        assert not made.is_over
        assert made.due_s(100.0 + turn * 0.1) == pytest.approx(0.0, abs=1e-9)
        made.send(100.0 + turn * 0.1, lambda: 0)
        assert made.due_s(100.0 + turn * 0.1) == pytest.approx(0.1)
    assert made.is_over


def test_who_was_late_makes_no_burst_of_it(pusher: FakePusher) -> None:
    made = prober(rate=10.0)
    made.send(100.0, lambda: 0)
    for _ in range(3):
        made.send(200.0, lambda: 0)
    assert made.due_s(200.0) > 0


def test_a_probe_has_a_label_and_what_was_asked_for(pusher: FakePusher) -> None:
    prober().send(100.0, lambda: 0)
    envelope, pdu, options = pusher.sent[0]
    assert envelope == b"v2x.cam."
    assert len(pdu) > 40
    assert json.loads(options) == {"interfaces": ["g5"], "label": f"{LABEL}/1"}


def test_the_way_from_user_to_user_is_by_one_clock(pusher: FakePusher) -> None:
    made = prober()
    made.send(100.0, lambda: 5 * S)
    made.delivered("B", digest_of(pusher.sent[0][1]), 5 * S + 3_000_000)
    made.delivered("B", digest_of(pusher.sent[0][1]), 7 * S)  # by its second way: its user has it
    made.delivered("B", "another", 6 * S)
    assert list(made.trips_us) == [Trip("A", "B")]
    assert list(made.trips_us["A", "B"].values()) == [3000.0]  # type: ignore[index]


def test_a_station_that_takes_nothing_is_told(pusher: FakePusher) -> None:
    pusher.is_full = True
    with pytest.raises(StationError, match="takes no more after 0 probes"):
        prober().send(100.0, lambda: 0)


def test_the_probes_of_two_meters_are_not_the_same() -> None:
    assert not {made.next() for made in [probes()] for _ in range(50)} & {
        made.next() for made in [probes()] for _ in range(50)
    }


def test_a_probe_is_sent_back_once_and_bit_for_bit(pusher: FakePusher) -> None:
    reflector = Reflector(None, client.Address(), {})  # type: ignore[arg-type]
    pdu = probes().next()
    for at_s in (1, 2):  # the second is its echo, by another reflector
        reflector.take(message(pdu), at_s * S, lambda: at_s * S + 200_000)  # noqa: B023
    reflector.take(message(bytes([2, 2]) + bytes(40)), 3 * S, lambda: 3 * S)
    assert [frames[1] for frames in pusher.sent] == [pdu]
    assert (reflector.reflected, reflector.not_reflected) == (1, 0)
    assert list(reflector.stay_us.values()) == [200.0]


def test_what_comes_again_after_a_minute_is_no_echo(pusher: FakePusher) -> None:
    reflector = Reflector(None, client.Address(), {})  # type: ignore[arg-type]
    pdu = probes().next()
    for at_s in (1, 3 + round(ECHO_S)):
        reflector.take(message(pdu), at_s * S, lambda: 0)
    assert reflector.reflected == 2


def test_what_the_station_does_not_take_is_counted(pusher: FakePusher) -> None:
    reflector = Reflector(None, client.Address(), {})  # type: ignore[arg-type]
    pusher.is_full = True
    reflector.take(message(probes().next()), S, lambda: S)
    assert (reflector.reflected, reflector.not_reflected) == (0, 1)
