"""Options of a bad way, as `captain replay` and `captain impair` have them."""

import argparse
from collections.abc import Mapping
from dataclasses import asdict

from drivers.wire.impairment import Burst, Counts, Impairments
from firmware.user.arguments import finite, integer, number

duration = number("seconds", 3600.0, is_zero_allowed=True)


def add_impairments(parser: argparse.ArgumentParser) -> None:
    """What a bad way does; impairments() reads it."""
    group = parser.add_argument_group("a bad way (all of it counted; the same seed does the same again)")
    group.add_argument("--loss", metavar="P", type=share, default=0.0, help="this share is lost: 0.1 is a tenth")
    group.add_argument(
        "--burst",
        metavar="P:R[:BAD[:GOOD]]",
        type=burst,
        help="losses in a row (Gilbert and Elliott): chances that a good way becomes bad and a bad one good again, "
        "before each; losses while it is bad (default 1) and good (default 0)",
    )
    group.add_argument("--delay", metavar="S", type=duration, default=0.0, help="each comes so much later")
    group.add_argument("--jitter", metavar="S", type=duration, default=0.0, help="up to so much later still, in order")
    group.add_argument(
        "--reorder", metavar="P", type=share, default=0.0, help="this share is overtaken by what follows"
    )
    group.add_argument(
        "--reorder-by", metavar="S", type=duration, default=0.02, help="held back for so long (default 0.02)"
    )
    group.add_argument("--duplicate", metavar="P", type=share, default=0.0, help="this share comes twice")
    group.add_argument("--bit-errors", metavar="P", type=share, default=0.0, help="this share of all bits is wrong")
    group.add_argument("--seed", metavar="N", type=integer(0, 2**63), default=1, help="of all chance (default 1)")


def impairments(options: argparse.Namespace) -> Impairments:
    """What the options of add_impairments() ask for."""
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
    """A part of all, 0 ... 1."""
    value = finite(text)
    if value is None or not 0.0 <= value <= 1.0:
        raise argparse.ArgumentTypeError(f"{text!r} is no share, which is 0 ... 1: 0.1 is a tenth")
    return value


def burst(text: str) -> Burst:
    """`P:R`, `P:R:BAD` or `P:R:BAD:GOOD`."""
    values = [finite(part) for part in text.split(":")]
    if not 2 <= len(values) <= 4 or any(value is None or not 0.0 <= value <= 1.0 for value in values):
        raise argparse.ArgumentTypeError(f"{text!r} is no P:R[:BAD[:GOOD]], each 0 ... 1: 0.01:0.25")
    return Burst(*(value for value in values if value is not None))


WORDS = {
    "lost": "lost",
    "burst_lost": "lost in bursts",
    "overflow": "lost, too many on their way",
    "duplicated": "came twice",
    "overtaken": "overtaken",
    "wrong": "with wrong bits",
}


def told(counts: Counts) -> str:
    """What a way did, in words; empty where it did nothing."""
    numbers: Mapping[str, int] = asdict(counts)
    parts = [f"{numbers[key]} {words}" for key, words in WORDS.items() if numbers[key]]
    return f"of {counts.taken}: {', '.join(parts)}" if parts else ""
