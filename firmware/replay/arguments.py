"""Options of a lossy link, for `captain replay` and `captain impair`."""

import argparse
from collections.abc import Mapping
from dataclasses import asdict

from drivers.wire.impairment import Burst, Counts, Impairments
from firmware.client.arguments import finite, integer, number

duration = number("seconds", 3600.0, is_zero_allowed=True)


def add_impairments(parser: argparse.ArgumentParser) -> None:
    """Add the options of a lossy link; impairments() reads their values."""
    group = parser.add_argument_group("a lossy link (counts each impairment; the same seed repeats all)")
    group.add_argument("--loss", metavar="P", type=share, default=0.0, help="lose this share: 0.1 is a tenth")
    group.add_argument(
        "--burst",
        metavar="P:R[:BAD[:GOOD]]",
        type=burst,
        help="lose several in a row (Gilbert-Elliott model): probabilities that a good link becomes bad and a bad one "
        "good, before each; share of losses while it is bad (default 1) and good (default 0)",
    )
    group.add_argument("--delay", metavar="S", type=duration, default=0.0, help="delay each by S seconds")
    group.add_argument("--jitter", metavar="S", type=duration, default=0.0, help="delay each by up to S more, in order")
    group.add_argument(
        "--reorder", metavar="P", type=share, default=0.0, help="hold this share back, so that others overtake"
    )
    group.add_argument(
        "--reorder-by", metavar="S", type=duration, default=0.02, help="hold it back for S seconds (default 0.02)"
    )
    group.add_argument("--duplicate", metavar="P", type=share, default=0.0, help="send this share twice")
    group.add_argument("--bit-errors", metavar="P", type=share, default=0.0, help="invert this share of all bits")
    group.add_argument(
        "--seed", metavar="N", type=integer(0, 2**63), default=1, help="seed of all random numbers (default 1)"
    )


def impairments(options: argparse.Namespace) -> Impairments:
    """Return the impairments that the options of add_impairments() give."""
    return Impairments(
        loss=options.loss,
        burst=options.burst,
        delay_s=options.delay,
        jitter_s=options.jitter,
        reorder=options.reorder,
        reorder_s=options.reorder_by,
        duplicate=options.duplicate,
        bit_errors=options.bit_errors,
        seed=options.seed,
    )


def share(text: str) -> float:
    """Parse a share from 0 to 1. Raises ArgumentTypeError for any other text."""
    value = finite(text)
    if value is None or not 0.0 <= value <= 1.0:
        raise argparse.ArgumentTypeError(f"{text!r}: not a share between 0 and 1; for example 0.1 for a tenth")
    return value


def burst(text: str) -> Burst:
    """Parse `P:R`, `P:R:BAD` or `P:R:BAD:GOOD`.

    Raises ArgumentTypeError for another form, or a value outside 0 to 1.
    """
    values = [finite(part) for part in text.split(":")]
    if not 2 <= len(values) <= 4 or any(value is None or not 0.0 <= value <= 1.0 for value in values):
        raise argparse.ArgumentTypeError(f"{text!r}: not P:R[:BAD[:GOOD]], each between 0 and 1; for example 0.01:0.25")
    return Burst(*(value for value in values if value is not None))


WORDS = {
    "lost": "lost",
    "burst_lost": "lost in bursts",
    "overflow": "lost, too many delayed",
    "duplicated": "sent twice",
    "overtaken": "overtaken",
    "wrong": "with wrong bits",
}


def told(counts: Counts) -> str:
    """Return the counts of a lossy link as text; empty if all are 0."""
    numbers: Mapping[str, int] = asdict(counts)
    parts = [f"{numbers[key]} {words}" for key, words in WORDS.items() if numbers[key]]
    return f"of {counts.taken}: {', '.join(parts)}" if parts else ""
