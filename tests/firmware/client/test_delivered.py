"""Delivered messages of port 5558: statuses, gaps, restarts, malformed reports."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from board.runtime.errors import StationError
from firmware.client.received import Delivered, Delivery
from tests.firmware.commands.fake import delivered

CAM = bytes.fromhex("02020000053900010203")


def report(sequence: int) -> list[bytes]:
    return list(delivered("cam", CAM, sequence))


def status(**told: object) -> list[bytes]:
    return [b"status.", json.dumps(told).encode()]


def test_delivered_gap_of_numbers_counts_as_missed() -> None:
    reader = Delivered()
    assert reader.feed(report(7)) is not None
    assert reader.missed == 0
    message = reader.feed(report(10))
    assert message is not None
    assert (message.missed, reader.missed) == (2, 2)


def test_delivered_status_of_another_run_begins_the_numbers_at_one() -> None:
    reader = Delivered()
    reader.feed(status(run="the run before"))
    reader.feed(report(3))
    assert reader.missed == 2


def test_delivered_status_without_a_run_is_refused_with_a_remedy() -> None:
    with pytest.raises(StationError, match="older release") as error:
        Delivered().feed(status(version="0.1.0"))
    assert "captain update" in error.value.hint


def test_delivered_malformed_status_counts_as_malformed() -> None:
    reader = Delivered()
    assert reader.feed([b"status.", b"{"]) is None
    assert reader.rubbish == 1


@given(st.lists(st.binary(max_size=200) | st.sampled_from([b"message.cam.", b"{}", CAM]), min_size=1, max_size=4))
def test_delivered_any_frames_never_raises_and_counts_malformed_ones(frames: list[bytes]) -> None:
    reader = Delivered()
    assert isinstance(reader.feed(frames), Delivery | None)
    assert reader.rubbish == 1
    assert len(reader.sample) <= 32
