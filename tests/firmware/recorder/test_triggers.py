"""Triggers of a recorder."""

import pytest

from firmware.recorder.triggers import ALL, EVENTS, LOSSES, SAME_EVENT_S, Triggers
from tests.firmware.recorder.reported_frames import told

DENM = {"type": "denm"}


def test_a_denm_triggers_once_for_as_long_as_it_is_repeated():
    triggers = Triggers(frozenset(ALL))
    assert triggers.frame(told(**DENM), 0, 0.0) == "denm"
    assert [triggers.frame(told(**DENM), 0, float(now)) for now in range(1, 200)] == [""] * 199
    assert triggers.frame(told(**DENM), 0, 199.0 + SAME_EVENT_S + 0.1) == "denm"


def test_denms_of_two_stations_are_two_events():
    triggers = Triggers(frozenset(ALL))
    assert [triggers.frame(told(**DENM, station_id=who), 0, 0.0) for who in (1, 2, 1)] == ["denm", "denm", ""]


def test_a_denm_of_others_with_the_own_number_hides_no_own_event():
    triggers = Triggers(frozenset(ALL))
    assert triggers.frame(told(**DENM), 0, 0.0) == "denm"
    assert triggers.frame(told(**DENM, direction="out"), 0, 1.0) == "denm"


def test_a_denm_that_was_dropped_is_no_event():
    assert Triggers(frozenset(ALL)).frame(told(**DENM, reason="gn-outside-area"), 0, 0.0) == ""


def test_stations_that_are_remembered_are_bounded():
    triggers = Triggers(frozenset(ALL))
    for who in range(5 * EVENTS):
        triggers.frame(told(**DENM, station_id=who), 0, 0.0)
    assert len(triggers._events) <= EVENTS + 1


@pytest.mark.parametrize("reason", ["queue-full", "expired", "kernel-queue", "send-failed"])
def test_losses_within_a_second_are_a_burst_that_triggers_once(reason):
    triggers = Triggers(frozenset(ALL))
    found = [triggers.frame(told(reason=reason), 0, number / 20) for number in range(3 * LOSSES)]
    assert found.count("loss") == 1
    assert found.index("loss") == LOSSES - 1


def test_what_is_missing_before_a_frame_counts_as_lost():
    assert Triggers(frozenset(ALL)).frame(told(), LOSSES, 0.0) == "loss"


def test_losses_here_and_there_are_no_burst():
    triggers = Triggers(frozenset(ALL))
    assert not any(triggers.frame(told(reason="expired"), 0, float(now)) for now in range(100))


def test_duplicates_are_no_loss():
    triggers = Triggers(frozenset(ALL))
    assert not any(triggers.frame(told(reason="duplicate"), 0, 0.0) for _ in range(100))


def test_time_by_pulses_that_is_so_no_more_triggers():
    triggers = Triggers(frozenset(ALL))
    states = ["unknown", "system", "locked", "locked", "holdover", "holdover", "locked", "system"]
    assert [triggers.time({"state": state}) for state in states] == ["", "", "", "", "gnss", "", "", "gnss"]


def test_what_is_not_wanted_does_not_trigger():
    triggers = Triggers(frozenset())
    assert triggers.frame(told(**DENM), 100, 0.0) == ""
    assert [triggers.time({"state": state}) for state in ("locked", "system")] == ["", ""]
