"""Reports of a station as events: whole, of other versions, or garbage."""

from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from firmware.meter.event import Clock
from firmware.meter.watch import status_fields

CONFIRM: dict[str, Any] = {
    "sequence": 7, "request": 3, "type": "cam", "station_id": 1337, "octets": 41, "digest": "0123456789abcdef",
    "outcome": "sent", "interface": "g5", "queue_us": 120.5, "send_us": 40.0, "accepted_ns": 1_795_182_426_461_613_001,
    "quality": {"state": "locked", "error_ns": 5_100, "offset_ns": -100, "uncertainty_ns": 5_000},
}  # fmt: skip
INDICATION: dict[str, Any] = {
    "sequence": 9, "type": "cam", "station_id": 1337, "octets": 41, "digest": "0123456789abcdef", "interface": "g5",
    "received_ns": 1_795_182_426_461_613_001, "rssi_dbm": -71, "quality": {"state": "unknown"},
}  # fmt: skip
ANYTHING = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from(sorted(CONFIRM)), inner, max_size=3),
    max_leaves=6,
)


def test_a_confirm_of_what_left_is_an_event_to_the_nanosecond() -> None:
    event = status_fields.sent("A", CONFIRM, "boot", 1.0)
    assert event is not None
    assert (event.accepted_ns, event.queue_ns, event.send_ns) == (1_795_182_426_461_613_001, 120_500, 40_000)
    assert (event.station, event.interface, event.what.digest) == ("A", "g5", "0123456789abcdef")
    assert event.clock == Clock("boot", -100, 5_000)


def test_a_confirm_of_anything_else_is_none() -> None:
    for outcome in ("accepted", "refused", "dropped", "", None):
        assert status_fields.sent("A", CONFIRM | {"outcome": outcome}, "boot", 1.0) is None


def test_a_confirm_of_an_older_station_is_none() -> None:
    assert (
        status_fields.sent("A", {key: value for key, value in CONFIRM.items() if key != "accepted_ns"}, "", 1.0) is None
    )


def test_an_indication_is_an_event_and_its_clock_is_not_known_where_nobody_says_it() -> None:
    event = status_fields.received("B", INDICATION, "boot", 1.0)
    assert (event.received_ns, event.rssi_dbm) == (1_795_182_426_461_613_001, -71)
    assert event.clock == Clock("boot")


def test_a_strength_that_none_can_be_is_none() -> None:
    for rssi_dbm in (10**400, -(10**6), True, 3.5, "x"):
        assert status_fields.received("B", INDICATION | {"rssi_dbm": rssi_dbm}, "boot", 1.0).rssi_dbm is None


@given(said=st.dictionaries(st.sampled_from(sorted({*CONFIRM, *INDICATION})), ANYTHING))
def test_rubbish_is_taken_and_harms_nobody(said: dict[str, Any]) -> None:
    status_fields.sent("A", said | {"outcome": "sent"}, "", 1.0)
    status_fields.received("B", said, "", 1.0)
    status_fields.interfaces({"interfaces": said})
