"""Result of a run: goals and a table."""

import math
from collections.abc import Sequence

from drivers.mqtt.options import IN_FLIGHT
from drivers.reason import Reason
from firmware.client.show.table import Table
from tests.proof.chaos.run import Goal
from tests.proof.outage.account import SENT, Account, Sums

ROWS = (
    ("sent", SENT),
    ("expired", Reason.EXPIRED),
    ("link down", Reason.LINK_DOWN),
    ("queue full", Reason.QUEUE_FULL),
)


def goals(account: Account, requests: int, connections: int) -> list[Goal]:
    """What has to hold of an interface that was given so many requests, and has connected so often."""
    sums, name = account.sums, account.name
    repeats = 0 if account.is_lossy else IN_FLIGHT * max(0, connections - 1)
    outcomes = sum(sums.outcomes.values())
    said = ", ".join(f"{count} {word or 'sent'}" for word, count in sorted(sums.outcomes.items()))
    offences = "; ".join(
        f"{what}: {count} ({', '.join(account.samples[what])})" for what, count in sorted(account.offences.items())
    )
    return [
        Goal(
            f"{name}: every request has its outcome",
            f"{requests} = {said}",
            requests == sums.requests == outcomes,
        ),
        Goal(
            f"{name}: none stale, none lost that could have left, each loss explained", offences or "none", not offences
        ),
        Goal(
            f"{name}: repeats are what was in flight when a connection was lost",
            f"{sums.repeats} of at most {repeats}, {connections} connections",
            sums.repeats <= repeats,
        ),
    ]


def table(accounts: Sequence[Account]) -> Table:
    """One column for each interface."""
    sums = [account.sums for account in accounts]
    rows = [
        ("requests", *(str(one.requests) for one in sums)),
        *((name, *(str(one.outcomes[word]) for one in sums)) for name, word in ROWS),
        ("arrived", *(str(one.arrived) for one in sums)),
        ("repeated", *(str(one.repeats) for one in sums)),
        ("said to be sent, did not arrive", *(str(one.sent_in_vain) for one in sums)),
        ("said to be dropped, yet arrived", *(str(one.dropped_yet_arrived) for one in sums)),
        ("arrived after its lifetime", *(str(one.arrived_late) for one in sums)),
        ("latest arrival after its lifetime", *(f"{max(0.0, one.longest_transit_s):.2f} s" for one in sums)),
        ("latest leaving before its end", *(_leaving(one) for one in sums)),
        ("latest word of a drop after it", *(f"{one.latest_word_s:.2f} s" for one in sums)),
    ]
    return Table("what became of the messages", ("", *(f">{account.name}" for account in accounts)), rows)


def _leaving(sums: Sums) -> str:
    return "not seen" if math.isinf(sums.latest_leaving_s) else f"{-1000 * sums.latest_leaving_s:.1f} ms"
