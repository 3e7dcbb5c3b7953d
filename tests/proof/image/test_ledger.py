"""Verdicts after a cut: lost, torn, changed."""

import json

import pytest

from tests.proof.image.ledger import Ledger


def line(word: str, **told: object) -> str:
    return f"\r\n@{word} {json.dumps(told)}\r\n"


def heard(*texts: str) -> Ledger:
    ledger = Ledger()
    for now_s, text in enumerate(texts):
        assert ledger.hear(text, float(now_s)).strip() == ""
    return ledger


def state(word: str, number: int) -> str:
    return line(word, what="state", number=number)


@pytest.mark.parametrize(
    ("has", "is_fine"), [(3, False), (4, True), (5, True), (6, False), (-1, False), ("torn", False)]
)
def test_what_was_acknowledged_has_to_be_there_and_what_was_begun_may_be(has: object, is_fine: bool):
    ledger = heard(state("begin", 4), state("done", 4), state("begin", 5))
    assert ledger.in_progress == ["state"]
    assert (ledger.troubles({"state": has}) == []) is is_fine


def test_what_was_begun_for_the_first_time_may_not_be_there():
    assert heard(state("begin", 1)).troubles({"state": -1}) == []


def test_after_a_look_the_card_decides():
    ledger = heard(state("begin", 4), state("done", 4), state("begin", 5))
    ledger.settle({"state": 5, "session": -1})
    assert ledger.in_progress == []
    assert ledger.troubles({"state": 5, "session": -1}) == []
    assert ledger.troubles({"state": 4, "session": -1})


def test_what_somebody_else_has_written_may_have_any_number_and_no_damage():
    ledger = heard(state("begin", 5), state("done", 5))
    ledger.forget("state")
    assert ledger.in_progress == []
    assert ledger.troubles({"state": 2, "machine-id": "a"}) == []
    assert ledger.troubles({"state": "torn: 7 octets", "machine-id": "a"}) == ["state: torn: 7 octets"]


def test_lines_may_come_in_parts_and_between_others():
    ledger = Ledger()
    rest = ledger.hear("systemd says\r\n" + state("begin", 7)[:-9], 0.0)
    assert ledger.begun == {}
    ledger.hear(rest + state("begin", 7)[-9:], 0.0)
    assert ledger.begun == {"state": 7}


def test_a_recording_has_lost_what_was_made_after_its_last_message_until_the_cut():
    ledger = heard(*(line("record", number=number, made_ns=10**9 * number) for number in (10, 11, 12)))
    assert ledger.lost_s(12 * 10**9, cut_s=2.25) == pytest.approx(0.25)
    assert ledger.lost_s(11 * 10**9, cut_s=2.25) == pytest.approx(1.25)
    assert ledger.lost_s(0, cut_s=2.25) == pytest.approx(2.25)  # nothing of it is there
    assert Ledger().lost_s(0, cut_s=2.0) == 0  # nothing was recorded


def test_a_box_keeps_who_it_is():
    ledger = Ledger()
    assert ledger.troubles({"machine-id": "a", "ssh": ""}) == []
    assert ledger.troubles({"machine-id": "a", "ssh": "k"}) == []
    assert ledger.troubles({"machine-id": "b", "ssh": "k"}) == ["machine-id has changed"]
    assert ledger.troubles({"machine-id": "a", "ssh": ""}) == ["ssh has changed"]
