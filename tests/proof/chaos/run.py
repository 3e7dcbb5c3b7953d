"""A run: patients, what is looked at all the time, and what is said of it at the end."""

import random
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

from board.description import Hardware
from drivers.sim.trouble import BOARD, TROUBLES
from firmware.client.show.table import Table
from tests.proof.chaos import limits
from tests.proof.chaos.patient import LIVELY, WORKER, Episode, Pace, Patient, Phase, Theatre

TICK_S = 0.25


class Goal(NamedTuple):
    """Something that has to hold, and what was seen of it."""

    what: str
    seen: str
    is_met: bool


class Run:
    """Gives trouble to the board and to every module that a board file has."""

    def __init__(self, theatre: Theatre, hardware: Hardware, seed: int, pace: Pace = LIVELY) -> None:
        self.began = theatre.now()
        self._pace = pace
        self.board = self._patient(theatre, hardware, BOARD, seed)
        is_disturbed: Callable[[], bool] = lambda: self.board.phase is Phase.ILL  # noqa: E731
        names = [name for name, slot in hardware.slots.items() if slot.ids]
        self.patients = [
            self.board,
            *(self._patient(theatre, hardware, name, seed, is_disturbed, limits.SWITCH_S) for name in names),
        ]

    def _patient(
        self,
        theatre: Theatre,
        hardware: Hardware,
        name: str,
        seed: int,
        is_disturbed: Callable[[], bool] = lambda: False,
        switch_s: float = 0.0,
    ) -> Patient:
        words = list(TROUBLES[name if name == BOARD else hardware.slots[name].ids[0]])
        if name == BOARD:
            words.append(WORKER.rpartition(" ")[2])
        limit_s, settle_s = limits.limit_s(hardware, name), limits.settle_s(hardware, name)
        chance = random.Random(f"{seed} {name}")
        return Patient(theatre, name, words, limit_s, settle_s, chance, is_disturbed, switch_s, self._pace)

    def tick(self) -> None:
        for patient in self.patients:
            patient.tick()

    def finish(self) -> None:
        """No further trouble."""
        for patient in self.patients:
            patient.is_over = True

    @property
    def is_well(self) -> bool:
        return all(patient.phase is Phase.WELL for patient in self.patients)

    @property
    def overdue(self) -> list[str]:
        return [patient.overdue for patient in self.patients if patient.overdue]

    @property
    def episodes(self) -> list[Episode]:
        return sorted(episode for patient in self.patients for episode in patient.episodes)

    @property
    def count(self) -> int:
        """Troubles."""
        return sum(episode.troubles.count(",") + 1 for episode in self.episodes)

    def goals(self) -> list[Goal]:
        late = [episode for episode in self.episodes if not episode.is_ok]
        unexplained = [f"{patient.name} at {at_s:.0f} s" for patient in self.patients for at_s in patient.unexplained]
        return [
            Goal("every module is back in its time", f"{len(self.episodes)} times", not late and not self.overdue),
            Goal("no module goes without trouble of its own", ", ".join(unexplained) or "none", not unexplained),
        ]


def timeline(episodes: Iterable[Episode]) -> Table:
    heads = (">at s", "module", "trouble", ">down s", ">back in s", ">within s", ">re-plugged", "")
    rows = [
        (
            f"{one.at_s:.0f}",
            one.name,
            one.troubles,
            f"{one.down_s:.1f}",
            f"{one.back_s:.1f}",
            f"{one.limit_s:.0f}",
            str(one.replugs or ""),
            "ok" if one.is_ok else "LATE",
        )
        for one in episodes
    ]
    return Table("timeline", heads, rows)


def summary(title: str, goals: Sequence[Goal]) -> Table:
    lines = [f"{'ok ' if goal.is_met else 'NOT MET:'} {goal.what}: {goal.seen}" for goal in goals]
    return Table(title, notes=lines)


def worst(episodes: Sequence[Episode]) -> Table:
    """By module: how often, and the longest."""
    names = sorted({one.name for one in episodes})
    rows = []
    for name in names:
        own = [one for one in episodes if one.name == name]
        rows.append(
            (
                name,
                str(len(own)),
                f"{sum(one.down_s for one in own):.0f}",
                f"{max(one.back_s for one in own):.1f}",
                f"{max(own, key=lambda one: one.back_s / one.limit_s).limit_s:.0f}",
                str(sum(one.replugs for one in own)),
            )
        )
    return Table("by module", ("module", ">times", ">down s", ">longest back in s", ">within s", ">re-plugged"), rows)
