"""Reception of messages: metadata, sequence numbers, malformed reports."""

import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from captain_client.message import Message
from captain_client.reception import Reception, Tally, check_types

PDU = bytes.fromhex("02029b260aa3")
TOLD: dict[str, Any] = {
    "run": "9f3c0a1be2d45566",
    "sequence": 17,
    "type": "cam",
    "interface": "g5",
    "received_ns": 1_795_182_426_461_613_000,
    "quality": {"state": "locked", "error_ns": 90, "offset_ns": 10, "uncertainty_ns": 80},
    "btp_port": 2001,
    "rssi_dbm": -71,
    "source": "02:00:00:00:00:0b",
    "position": {"latitude": 48.7668, "longitude": 11.4321},
    "security": "none",
    "data_rate": 12,
    "traffic_class": 2,
    "hop_limit": 1,
}


def frames(**changes: Any) -> list[bytes]:
    return [b"message.cam.", json.dumps(TOLD | changes).encode(), PDU]


def read(reception: Reception, **changes: Any) -> Message:
    message = reception.read(frames(**changes))
    assert message is not None
    return message


def missed(reception: Reception, *numbers: tuple[str, str, int]) -> list[int]:
    """Return how many messages were missed before each of these: run, type, sequence."""
    return [read(reception, run=run, type=kind, sequence=number).missed for run, kind, number in numbers]


def test_message_has_the_metadata_of_its_report():
    message = read(Reception(Tally()), implausible=["position-jump"])
    assert (message.type, message.pdu, message.station) == ("cam", PDU, 0x9B260AA3)
    told = {name: getattr(message, name) for name in TOLD if name not in ("run", "sequence")}
    assert told == {name: value for name, value in TOLD.items() if name not in ("run", "sequence")}
    assert message.implausible == ("position-jump",)


@pytest.mark.parametrize("told", [b'{"types": ["cam", "denm"]}', b'{"types": 7}', b'{"run": "1"}', b"["])
def test_check_of_known_types_or_of_a_station_that_does_not_tell_its_types_passes(told: bytes):
    check_types((b"message.", b"message.cam.", b"frame.g5.", b"status."), [b"status.", told])


def test_check_of_an_unknown_type_without_a_similar_one_names_all():
    with pytest.raises(ValueError, match="types: 'xyz': unknown to the station; known: cam, denm"):
        check_types((b"message.cam.", b"message.xyz."), [b"status.", b'{"types": ["cam", "denm"]}'])


def test_message_of_a_short_pdu_has_no_station():
    message = Reception(Tally()).read([*frames(type="")[:2], b"\2\2"])
    assert message is not None
    assert message.station is None
    assert repr(message) == "<message of station None, 2 octets, by g5>"


def test_gap_of_sequence_numbers_counts_as_missed_by_type():
    tally = Tally()
    numbers = [("a", "cam", 17), ("a", "denm", 3), ("a", "cam", 18), ("a", "cam", 21), ("a", "denm", 5)]
    assert missed(Reception(tally), *numbers) == [0, 0, 0, 2, 1]
    assert tally.missed == 3


def test_messages_of_a_new_run_are_counted_from_one_even_of_a_type_not_heard_before():
    numbers = [("a", "cam", 17), ("b", "cam", 3), ("b", "denm", 1), ("b", "spatem", 2), ("b", "cam", 4)]
    assert missed(Reception(Tally()), *numbers) == [0, 2, 0, 1, 0]


def test_messages_after_a_restart_are_counted_from_one_if_none_came_before_it():
    reception = Reception(Tally())
    reception.begin([b"status.", b'{"run": "a"}'])
    assert missed(reception, ("b", "cam", 3), ("b", "cam", 4)) == [2, 0]


def test_first_message_of_the_run_that_the_status_shows_has_none_missed_before_it():
    reception = Reception(Tally())
    reception.begin([b"status.", b'{"run": "a"}'])
    assert missed(reception, ("a", "cam", 17), ("a", "cam", 19)) == [0, 1]


@pytest.mark.parametrize("changes", [{"quality": None}, {"implausible": 7}, {"sequence": "x"}])
def test_malformed_report_counts_as_missed_before_the_next_message(changes: dict[str, Any]):
    tally = Tally()
    reception = Reception(tally)
    read(reception, sequence=1)
    body = json.dumps({name: value for name, value in (TOLD | {"sequence": 5} | changes).items() if value is not None})
    assert reception.read([b"message.cam.", body.encode(), PDU]) is None
    assert read(reception, sequence=6).missed == 4
    assert tally.missed == 4


@pytest.mark.parametrize("key", [key for key in TOLD if key != "implausible"])
def test_report_without_a_key_is_malformed_and_counts(key: str):
    tally = Tally()
    body = json.dumps({name: value for name, value in TOLD.items() if name != key}).encode()
    assert Reception(tally).read([b"message.cam.", body, PDU]) is None
    assert (tally.malformed, tally.missed) == (1, 0)


@pytest.mark.parametrize("number", ["1e999", '"x"', "null", "[]"])
def test_report_with_an_invalid_sequence_is_malformed(number: str):
    body = json.dumps(TOLD).replace('"sequence": 17', f'"sequence": {number}')
    assert Reception(Tally()).read([b"message.cam.", body.encode(), PDU]) is None


@given(octets=st.lists(st.binary(max_size=40), max_size=4), body=st.binary(max_size=40) | st.just(b"{}"))
def test_random_frames_are_malformed(octets: list[bytes], body: bytes):
    tally = Tally()
    assert Reception(tally).read([b"message.", body, *octets]) is None
    assert tally.malformed == 1
