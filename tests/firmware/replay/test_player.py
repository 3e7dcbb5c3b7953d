"""A player at an end that only keeps what it gets, on a clock that jumps."""

from dataclasses import replace

from board.runtime.errors import RequestError
from drivers.wire.impairment import Impairment, Impairments
from firmware.codec.reading import Pdu
from firmware.replay.player import Player
from firmware.replay.rewriting import Changes, Rewriting
from firmware.replay.timing import Timing

SECOND = 1_000_000_000


class Kept:
    """An end; what it sends, and when."""

    def __init__(self) -> None:
        self.now = 100.0
        self.sent: list[tuple[float, str]] = []

    def octets(self, one: Pdu) -> bytes:
        if not one.octets:
            raise RequestError(f"{one.origin}: a frame without a message: {one.carried}")
        return one.octets

    def send(self, octets: bytes, one: Pdu) -> None:
        if one.origin == "refused":
            raise RequestError(f"{one.origin}: too long")
        self.sent.append((round(self.now - 100.0, 6), one.origin))

    def wait(self, until: float) -> None:
        self.now = max(self.now, until)


def played(items, timing=Timing(), wanted=Impairments(), rounds=1):  # noqa: B008
    end, told = Kept(), []
    way = Impairment[Pdu](wanted)
    player = Player(end, way, Rewriting(Changes()), timing, told.append, lambda: end.now, lambda: 0)
    for _ in range(rounds):
        for _ in player.play(items):
            pass
    player.finish()
    return end.sent, player.played, way.counts, told


def pdu(origin: str, second: float) -> Pdu:
    return Pdu(b"\2\2\0\0\0\7", origin, when_ns=round(second * SECOND))


THREE = [pdu("a", 10), pdu("b", 10.5), pdu("c", 12)]


def test_each_goes_when_its_time_has_come():
    assert played(THREE)[0] == [(0, "a"), (0.5, "b"), (2, "c")]


def test_rounds_follow_each_other():
    assert played(THREE, Timing(rate=10), rounds=2)[0] == [
        (round(at / 10, 6), origin) for at, origin in enumerate("abcabc")
    ]


def test_a_delay_is_served_while_others_wait_and_after_the_last():
    sent, told, _, _ = played(THREE, wanted=Impairments(delay_s=0.7))
    assert sent == [(0.7, "a"), (1.2, "b"), (2.7, "c")]
    assert told.sent == 3


def test_what_the_way_loses_is_neither_sent_nor_left_out():
    many = [pdu(str(number), number) for number in range(100)]
    sent, told, counts, _ = played(many, wanted=Impairments(loss=0.3, duplicate=0.1))
    assert told.read == counts.taken == 100
    assert len(sent) == told.sent == 100 - counts.lost + counts.duplicated
    assert told.cause is None


def test_what_is_left_out_is_counted_by_its_reason_with_the_first_place():
    beacon = pdu("frame 7", 11)._replace(octets=b"", carried="beacons")
    sent, told, _, _ = played([*THREE, beacon, replace_origin(beacon, "frame 8")])
    assert len(sent) == 3
    assert told.left_out == {"a frame without a message: beacons": 2}
    assert told.examples == {"a frame without a message: beacons": "frame 7"}
    assert told.cause is None


def replace_origin(one: Pdu, origin: str) -> Pdu:
    return one._replace(origin=origin)


def test_a_thousand_reasons_take_no_more_room_than_fifty():
    many = [pdu(f"frame {at}", 10)._replace(octets=b"", carried=f"broken: {at}") for at in range(1000)]
    _, told, _, _ = played(many)
    assert len(told.left_out) == 51
    assert told.left_out.total() == 1000
    assert told.left_out["other reasons"] == 950


def test_what_cannot_be_sent_makes_it_bad():
    sent, told, _, _ = played([*THREE, pdu("refused", 13)])
    assert len(sent) == 3
    assert told.unsent == {"too long": 1}
    assert str(told.cause) == "refused: too long"


def test_what_cannot_be_read_is_told_and_the_next_goes():
    error = RequestError("a.hex: line 2: no digits")
    sent, told, _, heard = played([THREE[0], error, THREE[1]])
    assert len(sent) == 2
    assert (heard, told.unreadable, told.cause) == ([error], 1, error)


def test_a_cut_is_not_read_as_missing():
    sent, told, _, _ = played(THREE, replace(Timing(), from_s=0.4, to_s=1.0))
    assert sent == [(0.1, "b")]
    assert told.left_out == {"outside of --from and --to": 2}
