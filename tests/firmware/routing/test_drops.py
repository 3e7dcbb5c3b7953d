"""Drops: place, reason, count, and the last one."""

import logging

import pytest

from drivers.reason import MEANING, Reason
from firmware.routing.drops import DETAIL, SAMPLE, USUAL, Drops


def test_each_place_and_reason_has_a_count_of_its_own() -> None:
    drops = Drops()
    drops.count("g5", Reason.SHORT_PDU)
    drops.count("g5", Reason.SHORT_PDU)
    drops.count("g5", Reason.LONG_PDU)
    drops.count("pull", Reason.SHORT_PDU)
    assert drops.total("g5", Reason.SHORT_PDU) == 2
    assert drops.total("g5", Reason.LONG_PDU) == 1
    assert drops.total("pull", Reason.SHORT_PDU) == 1


def test_what_never_happened_counts_zero_and_is_not_shown() -> None:
    drops = Drops()
    assert drops.total("g5", Reason.CHECKSUM) == 0
    assert list(drops.status()) == []


def test_the_sample_is_the_last_one_and_is_bounded() -> None:
    drops = Drops()
    drops.count("g5", Reason.LONG_PDU, b"first")
    drops.count("g5", Reason.LONG_PDU, b"\xab" * 1_000_000)
    (said,) = drops.status()
    assert said["sample"] == "ab" * SAMPLE
    assert said["octets"] == 1_000_000


def test_a_count_without_octets_keeps_the_sample_that_there_was() -> None:
    drops = Drops()
    drops.count("g5", Reason.KERNEL_QUEUE, b"\x01\x02")
    drops.count("g5", Reason.KERNEL_QUEUE, count=40)
    (said,) = drops.status()
    assert (said["sample"], said["octets"], said["count"]) == ("0102", 2, 41)


def test_the_status_says_the_reason_in_a_code_and_in_words() -> None:
    drops = Drops()
    drops.count("from_users", Reason.ONE_FRAME, b"x")
    (said,) = drops.status()
    assert (said["where"], said["reason"], said["meaning"]) == (
        "from_users",
        "one-frame",
        MEANING[Reason.ONE_FRAME],
    )


def test_every_reason_has_a_meaning() -> None:
    missing = [reason.name for reason in Reason if not MEANING.get(reason)]
    assert not missing, "add each to drivers/reason.py with its line in MEANING"


def test_a_hundred_thousand_drops_take_one_entry() -> None:
    drops = Drops()
    for number in range(100_000):
        drops.count("g5", Reason.TRUNCATED, number.to_bytes(4, "big"))
    (said,) = drops.status()
    assert (said["count"], said["sample"]) == (100_000, "0001869f")


def journal(caplog: pytest.LogCaptureFixture, level: int) -> list[str]:
    return [record.getMessage() for record in caplog.records if record.levelno == level]


def test_the_journal_hears_of_the_first_the_tenth_and_the_hundredth(caplog: pytest.LogCaptureFixture) -> None:
    drops = Drops()
    for _ in range(999):
        drops.count("g5", Reason.TRUNCATED)
    lines = journal(caplog, logging.WARNING)
    assert [line.split(": ")[2].split()[0] for line in lines] == ["1", "10", "100"]


def test_a_jump_over_a_power_of_ten_is_said_once(caplog: pytest.LogCaptureFixture) -> None:
    drops = Drops()
    drops.count("g5", Reason.KERNEL_QUEUE, count=5)
    drops.count("g5", Reason.KERNEL_QUEUE, count=4000)
    drops.count("g5", Reason.KERNEL_QUEUE, count=4000)
    assert len(journal(caplog, logging.WARNING)) == 2


@pytest.mark.parametrize("reason", sorted(USUAL))
def test_what_a_healthy_station_discards_is_no_warning(caplog: pytest.LogCaptureFixture, reason: Reason) -> None:
    caplog.set_level(logging.INFO)
    Drops().count("g5", reason)
    assert journal(caplog, logging.WARNING) == []
    assert len(journal(caplog, logging.INFO)) == 1


def test_a_detail_is_that_of_the_last_sample_and_bounded() -> None:
    drops = Drops()
    drops.count("v2n", Reason.SEND_FAILED, b"first", detail="no position: nothing is published by tile")
    drops.count("v2n", Reason.SEND_FAILED, b"last", detail="x" * 10_000)
    (said,) = drops.status()
    assert said["detail"] == "x" * DETAIL
    drops.count("v2n", Reason.SEND_FAILED, b"another")
    (said,) = drops.status()
    assert said["detail"] == ""


def test_the_journal_tells_the_detail(caplog: pytest.LogCaptureFixture) -> None:
    drops = Drops()
    with caplog.at_level(logging.INFO, "captain.drops"):
        drops.count("v2n", Reason.SEND_FAILED, b"first", detail="no position")
    assert caplog.messages == [f"v2n: send-failed: 1 dropped: {MEANING[Reason.SEND_FAILED]}: no position"]
