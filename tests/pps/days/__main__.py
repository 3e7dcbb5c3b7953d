"""A day for each fault and as many random ones as are asked for: python -m tests.pps.days --days 365 --seed 1."""

import argparse
import os
import sys
import time
from multiprocessing import Pool
from typing import NamedTuple

from firmware.client.show.table import Screen
from tests.pps.days.account import HOLDOVER, PULSES, Account
from tests.pps.days.day import Day, Plan
from tests.pps.days.plans import days, random_day
from tests.proof.chaos.run import summary

# wrong: seconds passed on that are not the true ones. false: edges that are not the receiver's, in a right second.
# lost: good pulses that were refused. error: what 95 % are below; bound: the median. hold: the time without pulses.
HEADS = (
    f"{'day':22} {'passed':>6} {'wrong':>5} {'false':>5} {'lost':>4} {'back s':>6} {'inside %':>8} {'error us':>8} {'bound us':>8}"
    f" {'ratio':>5} {'hold: %':>7} {'error us':>8} {'worst us':>8} {'bound us':>8} {'ratio':>5} {'cpu s':>5}"
)


class Played(NamedTuple):
    """A day, what was seen, and the processor's seconds for it."""

    name: str
    account: Account
    seconds: float


def play(plan: Plan) -> Played:
    """In a process of its own."""
    began = time.process_time()
    account = Day(plan).play()
    return Played(plan.name, account, time.process_time() - began)


def row(played: Played) -> str:
    """A line below HEADS."""
    account = played.account
    pulses, hold = account.known[PULSES], account.known[HOLDOVER]
    line = (
        f"{played.name:22} {account.passed:6} {account.wrong:5} {account.false:5} {account.refused_good:4} {account.back_s:6}"
        f" {account.all.inside_share:8.3%} {pulses.usual_error_ns / 1e3:8.1f} {pulses.usual_bound_ns / 1e3:8.1f}"
        f" {pulses.ratio:5.2f}"
    )
    if len(hold.errors) > 1:
        line += (
            f" {hold.inside_share:7.2%} {hold.usual_error_ns / 1e3:8.0f} {max(hold.errors) / 1e3:8.0f}"
            f" {hold.usual_bound_ns / 1e3:8.0f} {hold.ratio:5.2f}"
        )
    else:
        line += f" {'-':>7} {'-':>8} {'-':>8} {'-':>8} {'-':>5}"
    return f"{line} {played.seconds:5.1f}"


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.pps.days", description=__doc__)
    parser.add_argument("--days", type=int, default=20, help="random ones, after those of the faults (20)")
    parser.add_argument("--seed", type=int, default=1, help="of the first random day (1)")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="processes (as many as there are processors)")
    options = parser.parse_args()
    plans = [*days(), *(random_day(options.seed + number) for number in range(options.days))]
    together = Account()
    print(HEADS)
    with Pool(options.jobs) as pool:
        for played in pool.imap(play, plans):
            print(row(played), flush=True)
            for goal in played.account.goals_of_day():
                if not goal.is_met:  # of an estimate: not in this day
                    print(f"  {goal.what}: {goal.seen}", flush=True)
            together.add(played.account)
    goals = together.goals()
    Screen().show([summary(f"{len(plans)} days together", goals)])
    print(f"refused: {', '.join(f'{why} {count}' for why, count in together.refused.most_common())}")
    return int(not all(goal.is_met for goal in goals))


if __name__ == "__main__":
    sys.exit(main())
