"""Clock of the box, steered by this machine's pulses and chronyd.

Two parts in the guest are not the card's. Root's agent reads its clocks and sets the clock wrong, with a Python of
its own by 9p. In `pulses`, a program takes them from /dev/pps0.
"""

from collections.abc import Callable, Iterator
from pathlib import Path

from tests.proof.clock import leap, pulses, steered
from tests.proof.clock.card import Card, prepare
from tests.proof.clock.machine import Kind, LateError
from tests.proof.clock.rows import Row as Figure
from tests.proof.image.machine import NotSeenError
from tests.proof.image.rows import Options, Row

PULSES = 30
CALM_S, OUTAGE_S = 60.0, 60.0
PARTS: dict[str, Callable[[Kind], list[Figure]]] = {
    "pulses": lambda made: pulses.measure(made, PULSES),
    "steered": lambda made: steered.measure(made, CALM_S, OUTAGE_S),
    "leap": leap.measure,
}


def rows(card: Path, folder: Path, options: Options) -> Iterator[Row]:
    prepare()
    made = Card(card)
    for name in ("steered",) if options.is_short else PARTS:
        try:
            for figure in PARTS[name](made):
                yield Row(f"{name}: {figure.what}", figure.seen, figure.goal, not figure.trouble)
        except LateError as error:
            raise NotSeenError(str(error)) from error
