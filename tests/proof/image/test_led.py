"""Count of an LED's blinks."""

from tests.proof.image.led import Change, counted

ON_S, OFF_S, PAUSE_S = 0.2, 0.3, 1.8


def shown(*groups: int, begins_s: float = 0.0) -> list[Change]:
    changes, now = [], begins_s
    for group in groups:
        for _ in range(group):
            changes += [Change(now, True), Change(now + ON_S, False)]
            now += ON_S + OFF_S
        now += PAUSE_S - OFF_S
    return changes


def test_groups_between_two_pauses_are_counted():
    assert counted(shown(2, 2, 2, 1)) == [2, 2]
    assert counted(shown(4, 4, 4, 4)) == [4, 4]


def test_a_group_that_was_not_seen_whole_does_not_count():
    assert counted(shown(3, 3, 3)[2:]) == [3]  # it begins behind the first blink
    assert counted(shown(3, 3, 3)[1:-1]) == [3]  # and where it is lit


def test_a_led_that_does_not_blink_has_no_groups():
    assert counted([]) == []
    assert counted([Change(1.0, True)]) == []
    assert counted(shown(5)) == []
