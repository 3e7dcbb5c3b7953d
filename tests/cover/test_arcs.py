"""A branch is known by texts, so that it may move."""

from tests.cover.arcs import Arc, Arcs, Source

CODE = """class Gate:
    def open(self):
        if self.is_open:
            return
        self.is_open = True
"""


def test_arc_moved_branch_stays_the_same() -> None:
    moved = Source("import os\n\n" + CODE)
    assert moved.arc([5, 6]) == Source(CODE).arc([3, 4]) == Arc("Gate.open", "if self.is_open:", "return")


def test_arc_way_out_of_a_function_leads_to_exit() -> None:
    assert Source(CODE).arc([3, -2]) == Arc("Gate.open", "if self.is_open:", "exit")


def test_arc_of_a_renamed_function_is_gone_and_not_lost() -> None:
    kept, renamed = Arc("Gate.open", "if self.is_open:", "return"), Arc("Gate.shut", "if self.is_open:", "return")
    before = Arcs(frozenset({kept, renamed}), frozenset({kept, renamed}))
    now = Arcs(frozenset(), frozenset({kept}))
    assert (before.lost(now), before.gone(now)) == ({kept}, {renamed})
