"""Buffer of waiting items: the latest of each, or all."""

from firmware.gateway.captain_gateway.captain_gateway.buffer import Buffer
from firmware.gateway.captain_gateway.captain_gateway.settings import HANDLER, transmit

DEFAULTS = {name: option.default for name, option in HANDLER.items()} | {"transmit.rate_hz": 10.0}
LATEST = transmit(DEFAULTS)
ALL = transmit(DEFAULTS | {"transmit.buffer": "all", "transmit.depth": 3})
REPEATED = transmit(DEFAULTS | {"transmit.repeat_s": 1.0})


def test_the_newer_replaces_the_older_of_the_same_thing():
    buffer: Buffer[str] = Buffer()
    assert buffer.put("a", "a1", 0.0, LATEST) == []
    assert buffer.put("b", "b1", 0.0, LATEST) == []
    assert buffer.put("a", "a2", 0.0, LATEST) == ["a1"]
    assert buffer.due(0.1, LATEST) == ["b1", "a2"]
    assert buffer.due(0.2, LATEST) == []


def test_all_are_sent_one_in_a_period_in_their_order():
    buffer: Buffer[str] = Buffer()
    for item in ("1", "2", "3"):
        assert buffer.put("a", item, 0.0, ALL) == []
    assert [buffer.due(0.0, ALL) for _ in range(4)] == [["1"], ["2"], ["3"], []]


def test_where_too_many_wait_the_oldest_goes_and_is_told():
    buffer: Buffer[str] = Buffer()
    gone = [buffer.put("a", item, 0.0, ALL) for item in "12345"]
    assert gone == [[], [], [], ["1"], ["2"]]


def test_what_is_repeated_ends_with_its_time_or_a_newer_one():
    buffer: Buffer[str] = Buffer()
    buffer.put("a", "a1", 0.0, REPEATED)
    assert buffer.due(0.1, REPEATED) == ["a1"]
    assert buffer.due(0.9, REPEATED) == ["a1"]
    assert buffer.put("a", "a2", 1.0, REPEATED) == []  # the first was sent: nothing is lost
    assert buffer.due(1.9, REPEATED) == ["a2"]
    assert buffer.due(2.1, REPEATED) == []
    assert buffer.due(2.2, REPEATED) == []


def test_what_was_never_sent_is_sent_however_late_its_period_is():
    buffer: Buffer[str] = Buffer()
    buffer.put("a", "a1", 0.0, REPEATED)
    assert buffer.due(50.0, REPEATED) == ["a1"]


def test_no_more_things_are_kept_than_the_depth():
    buffer: Buffer[int] = Buffer()
    gone = [buffer.put(number, number, 0.0, LATEST) for number in range(12)]
    assert gone[-2:] == [[0], [1]]
    assert buffer.due(0.0, LATEST) == list(range(2, 12))


def test_what_waits_is_told_when_it_is_thrown_away():
    buffer: Buffer[str] = Buffer()
    buffer.put("a", "a1", 0.0, REPEATED)
    buffer.due(0.0, REPEATED)
    buffer.put("b", "b1", 0.0, REPEATED)
    assert buffer.clear() == ["b1"]
    assert buffer.clear() == []
