"""Plan of a hundred cuts, and the rows of their results."""

from collections import Counter

import pytest

from tests.proof.image.cuts import KINDS, Cut, _clean, _kept, plan
from tests.proof.image.medium import Fate, Loss
from tests.proof.image.power import Look


def cut(look: Look | None = None, fate: Fate = Fate.DROP, during: tuple[str, ...] = ()) -> Cut:
    return Cut(KINDS[0], fate, during, Loss(3, 1, 1, 1), look or Look(), 10.0)


@pytest.mark.parametrize("count", [5, 10, 37, 100, 250])
def test_each_kind_of_cut_has_its_share_and_the_order_is_always_the_same(count: int):
    planned = plan(count)
    assert len(planned) == count
    assert planned == plan(count)
    assert set(Counter(kind for kind, _ in planned)) == set(KINDS)


def test_a_hundred_cuts_meet_every_kind_of_drive_and_few_only_a_dying_machine():
    planned = plan(100)
    assert Counter(kind for kind, _ in planned) == {kind: kind.share for kind in KINDS}
    fates = Counter(fate for _, fate in planned)
    assert set(fates) == set(Fate)
    assert fates[Fate.KEEP] <= 10


def test_the_short_form_has_no_start_of_the_whole_system():
    kinds = Counter(kind for kind, _ in plan(10, is_short=True))
    assert kinds == dict(zip(KINDS, (8, 1, 1), strict=False))
    assert all(kind.is_quick for kind in kinds)


def test_one_start_that_is_not_clean_misses_the_goal_where_it_was():
    rows = {row.what: row for row in _clean([cut(), cut(Look(("session: torn",)), Fate.TEAR)])}
    assert rows["power cuts, and clean starts after them"].seen == "2 cuts, 1 clean"
    assert not rows["power cuts, and clean starts after them"].is_ok
    assert not rows["a drive that tears"].is_ok
    assert rows["a drive that loses"].is_ok


def test_cuts_are_counted_by_what_they_met():
    rows = {row.what: row for row in _clean([cut(during=("owner", "counters")), cut(during=("state-1.json",))])}
    assert rows["in the middle of"].seen == "configuration 2, update 1, recording 2"


@pytest.mark.parametrize(
    ("configurations", "updates", "is_ok"), [(14, 3, True), (13, 3, False), (14, 2, False), (0, 0, False)]
)
def test_many_cuts_have_to_meet_configurations_and_updates(configurations: int, updates: int, is_ok: bool):
    met = [cut(during=("owner",))] * configurations + [cut(during=("slot",))] * updates
    rows = {row.what: row for row in _clean(met + [cut()] * (74 - len(met)))}
    assert rows["in the middle of"].goal == "at least configuration 14, update 3"
    assert rows["in the middle of"].is_ok is is_ok


def test_a_recording_may_lose_its_last_second_and_no_more():
    assert all(row.is_ok for row in _kept([cut(Look(lost_s=0.4)), cut(Look(lost_s=1.0))]))
    missed = [row.what for row in _kept([cut(Look(lost_s=1.1))]) if not row.is_ok]
    assert missed == ["lost of a recording"]


def test_what_is_torn_or_changed_is_quoted():
    rows = list(_kept([cut(Look(("machine-id has changed",)))]))
    assert rows[0].seen == "machine-id has changed"
    assert not rows[0].is_ok
