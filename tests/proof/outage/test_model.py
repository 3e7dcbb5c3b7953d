"""The network and the road of the virtual day: what a kernel keeps, and what is around a vehicle."""

import pytest

from drivers.message import Ego
from drivers.wire.quadkey import tile
from tests.proof.outage import road
from tests.proof.outage.network import HEADER, SLOW_DELAY_S, Line, Network
from tests.proof.outage.pattern import Kind, Trouble
from tests.proof.outage.road import Followed
from tests.virtual import VirtualLoop

# The model of the network.


def sent(network: Network, stall_s: float = 3.0) -> tuple[Line, list[float], list[str]]:
    """A connection in which one message is under way: when it arrives, and what the connection ends with."""
    arrived: list[float] = []
    ended: list[str] = []
    line = Line(network, stall_s, ended.append)
    line.up.send(100, lambda: arrived.append(network.loop.clock()))
    return line, arrived, ended


@pytest.mark.parametrize("kind", [Kind.TUNNEL, Kind.LOSS])
def test_what_was_sent_into_a_short_outage_arrives_after_it(kind: Kind) -> None:
    network = Network(loop := VirtualLoop(now=0.0))
    network.begin(trouble := Trouble(0.0, kind, 1.0))
    loop.after(trouble.lasts_s, lambda: network.end(trouble))
    _, arrived, ended = sent(network)
    loop.run_for(10.0)
    assert (len(arrived), ended) == (1, [])
    assert 1.0 < arrived[0] < 2.0


@pytest.mark.parametrize(
    ("kind", "lasts_s", "stall_s", "is_ended"),
    [(Kind.TUNNEL, 5.0, 3.0, True), (Kind.HANDOVER, 0.5, 3.0, True), (Kind.HANDOVER, 0.5, 0.0, False)],
)
def test_what_was_sent_from_an_address_that_is_gone_or_before_the_limit_never_arrives(
    kind: Kind, lasts_s: float, stall_s: float, is_ended: bool
) -> None:
    network = Network(loop := VirtualLoop(now=0.0))
    network.begin(trouble := Trouble(0.0, kind, lasts_s))
    loop.after(lasts_s, lambda: network.end(trouble))
    _, arrived, ended = sent(network, stall_s)
    loop.run_for(30.0)
    assert arrived == []
    assert bool(ended) is is_ended


def test_the_kernel_takes_no_more_at_once_than_its_buffer_holds() -> None:
    network = Network(VirtualLoop(now=0.0))
    network.begin(Trouble(0.0, Kind.TUNNEL, 60.0))
    taken: list[int] = []
    line = Line(network, 0.0, lambda why: None)
    asked = 0
    for number in range(20):
        asked += line.up.is_writable
        line.up.send(1000, lambda: None, lambda number=number: taken.append(number))
    assert (asked, taken) == (4, list(range(5)))


def test_a_socket_that_is_full_stays_so_for_seconds_in_a_slow_network() -> None:
    network = Network(loop := VirtualLoop(now=0.0))
    network.begin(Trouble(0.0, Kind.SLOW, 60.0, 16_000))
    arrived: list[float] = []
    room: list[float] = []
    line = Line(network, 3.0, lambda why: None)
    line.up.on_room = lambda: room.append(loop.now)
    while line.up.is_writable:
        line.up.send(1940, lambda: arrived.append(loop.now))  # with its header one second of this network
    loop.run_for(10.0)
    assert arrived == pytest.approx([1.0 + SLOW_DELAY_S, 2.0 + SLOW_DELAY_S])
    assert room == arrived[:1]


@pytest.mark.parametrize("rate_bit_s", [16_000, 48_000])
def test_a_slow_network_lets_through_as_much_from_a_sender_that_waits_for_room(rate_bit_s: int) -> None:
    network = Network(loop := VirtualLoop(now=0.0))
    network.begin(Trouble(0.0, Kind.SLOW, 60.0, rate_bit_s))
    arrived: list[float] = []
    line = Line(network, 3.0, lambda why: None)

    def fill() -> None:
        while line.up.is_writable:
            line.up.send(130, lambda: arrived.append(loop.now))

    line.up.on_room = fill
    fill()
    loop.run_for(60.0)
    assert len(arrived) == pytest.approx(60.0 * rate_bit_s / 8 / (130 + HEADER), rel=0.03)


# Where the vehicle is.


def followed(depth: int, is_usable: bool = True) -> tuple[Followed, Ego, set[str]]:
    """A path that is subscribed to what is around the place at 1000 s, at a depth."""
    own = road.ego(1000.0)
    filters = {f"5GCroCo/outQueue/v2x/cam/+/{'/'.join(one.digits())}/#" for one in tile(own.position, depth).around()}
    return Followed(filters, lambda begin, end, need_s: is_usable), own, filters


def seen(one: Followed, own: Ego) -> float:
    for second in range(10):
        one.look(own, False, 1000.0 + second)
    return one.longest_s


def test_nine_tiles_with_the_vehicle_in_their_middle_are_right() -> None:
    own = road.ego(1000.0)
    depth = road.DEPTH - sum(own.speed / 100 >= limit for limit in road.SPEEDS)
    assert seen(followed(depth)[0], own) == 0.0
    assert seen(followed(depth + 1)[0], own) == 10.0
    assert seen(followed(depth)[0], road.ego(1000.0 + road.PERIOD_S)) == 10.0
    assert seen(followed(depth, is_usable=False)[0], road.ego(1000.0 + road.PERIOD_S)) == 0.0


@pytest.mark.parametrize("what", ["one is missing", "one is left over"])
def test_another_number_of_tiles_than_nine_is_wrong(what: str) -> None:
    own = road.ego(1000.0)
    one, _, filters = followed(road.DEPTH - sum(own.speed / 100 >= limit for limit in road.SPEEDS))
    if what == "one is missing":
        filters.pop()
    else:
        filters.add("5GCroCo/outQueue/v2x/cam/+/0/1/2/#")
    assert seen(one, own) == 10.0
