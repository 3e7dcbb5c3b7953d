"""python -m tests.asn1.truth: generated values of every message, our codec against all others, and the table of it.

Then PDUs of each edition, tried with every other edition that their header announces as well: confusion.py.

Needs the message library (`make codec`); pycrate and tshark where they are installed.
"""

import argparse
import functools
import importlib
import importlib.util
import multiprocessing
import sys
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from asn1.model import text
from asn1.model import types as t
from tests.asn1 import confusion, tshark
from tests.asn1.disagreements import TABLE
from tests.asn1.trial import Codec, Tally, Trial, chunks

LIBRARY = Path("build/codec/python")
CHUNK = 10_000
CONFUSED = 1_000  # PDUs of an edition in one part: a part takes 2 s
# Of how many values one goes to each. A value takes us 0.03 to 0.6 ms, asn1tools 0.2 to 2, pycrate 0.5 to 5 ms.
EVERY = {"asn1tools": 20, "pycrate": 60, "tshark": 100}
COLUMNS = "{:<25}{:>10}{:>10}{:>19}{:>17}{:>15}{:>11}{:>13}"


class Task(NamedTuple):
    message: str
    seed: int
    values: int
    every: tuple[tuple[str, int], ...]


def library() -> Any:
    """captain_messages, as built. Raises ImportError."""
    if str(LIBRARY) not in sys.path:
        sys.path.insert(0, str(LIBRARY))
    return importlib.import_module("captain_messages")


@functools.lru_cache(maxsize=1)
def schema() -> t.Schema:
    return text.load_schema()


def every(message: t.Message, wanted: dict[str, int]) -> dict[str, int]:
    """The codecs that are here and know the message."""
    has_pycrate = importlib.util.find_spec("pycrate_asn1rt") is not None
    knows = {"asn1tools": True, "pycrate": has_pycrate, "tshark": tshark.IS_HERE and message.name in tshark.MESSAGES}
    return {name: one for name, one in wanted.items() if one and knows[name]}


@functools.lru_cache(maxsize=2)
def trial(name: str, rates: tuple[tuple[str, int], ...]) -> Trial:
    message = schema().messages[name]
    codec: Codec = library().find(name)
    return Trial(schema(), message, codec, every(message, dict(rates)))


def run(task: Task) -> tuple[str, Tally]:
    return task.message, trial(task.message, task.every).run(task.seed, task.values)


@functools.lru_cache(maxsize=1)
def confused() -> confusion.Trial:
    return confusion.Trial(schema(), library().all())


def confuse(task: Task) -> tuple[str, confusion.Confused]:
    return task.message, confused().run(task.message, task.values, confusion.SEED + task.seed)


def confusions(messages: list[t.Message], count: int) -> list[Task]:
    """count PDUs of each edition that has a header."""
    return [Task(one.name, seed, part, ()) for one in messages if one.ids for seed, part in chunks(count, CONFUSED)]


def tasks(messages: list[t.Message], count: int, rates: dict[str, int]) -> Iterator[Task]:
    """count values of every type of message, shared by its editions."""
    editions = Counter(one.type for one in messages)
    for message in messages:
        for seed, part in chunks(-(-count // editions[message.type]), CHUNK):
            yield Task(message.name, seed, part, tuple(rates.items()))


def main(arguments: list[str] | None = None) -> int:
    options = _options(arguments)
    rates = {name: getattr(options, name) for name in EVERY}
    messages = [one for one in schema().messages.values() if not options.message or one.name in options.message]
    todo = list(tasks(messages, options.count, rates))
    tallies = {one.name: Tally() for one in messages}
    parts = Counter(task.message for task in todo)
    began = time.monotonic()
    with multiprocessing.get_context("spawn").Pool(options.processes) as pool:
        for name, tally in pool.imap_unordered(run, todo):
            tallies[name].add(tally)
            parts[name] -= 1
            if not parts[name]:  # an hour is long: whoever breaks it off has seen this much
                print(f"{time.monotonic() - began:5.0f} s {_row(name, tallies[name])}", file=sys.stderr, flush=True)
        print("\n".join(report(tallies, rates)), flush=True)
        found = {one.name: confusion.Confused() for one in messages if one.ids}
        for name, one in pool.imap_unordered(confuse, confusions(messages, options.editions)):
            found[name].add(one)
    print("\n" + "\n".join(confusion.report(found)))
    print(f"\n{time.monotonic() - began:.0f} s with {options.processes} processes")
    return int(any(tally.unexplained for tally in tallies.values()) or any(one.silent for one in found.values()))


def report(tallies: dict[str, Tally], rates: dict[str, int]) -> Iterator[str]:
    """The table by message, the table of what is explained, and examples of what is not."""
    yield "All values: our octets are those of an encoder written from the text of X.691, and decode to the value."
    shares = ", ".join(f"{name} 1 in {one}" for name, one in rates.items() if one)
    yield f"Agreed / compared, octets and decoded value: {shares}."
    yield "Newer values hold additions that no edition knows: of those only what asn1tools reads, which skips them.\n"
    yield COLUMNS.format("message", "values", "newer", "asn1tools", "pycrate", "tshark", "explained", "unexplained")
    total = Tally()
    for name, tally in tallies.items():
        yield _row(name, tally)
        total.add(tally)
    yield _row("all", total)
    yield "\nexplained: who is wrong, and by which clause"
    for row in TABLE:
        for codec in row.codecs:
            # A row of tshark 4.4 is counted for tshark.
            if number := total.reasons[codec.partition(" ")[0], row.construct]:
                yield f"{number:>10}  {codec:<10} {row.construct} ({row.clause}): {row.who_is_wrong}"
    for tally in tallies.values():
        yield from (f"\nunexplained: {example}" for example in tally.examples)


def _row(name: str, tally: Tally) -> str:
    shares = [f"{tally.agreed[codec]}/{tally.compared[codec]}" if tally.compared[codec] else "-" for codec in EVERY]
    return COLUMNS.format(name, tally.values, tally.newer, *shares, tally.explained, tally.unexplained)


def _options(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.asn1.truth", description=__doc__)
    parser.add_argument("--count", type=int, default=1_000_000, help="values of each type of message (default 1000000)")
    parser.add_argument(
        "--message", action="append", help="only this edition, as cam-1.4.1; may be given several times"
    )
    parser.add_argument(
        "--editions", type=int, default=10_000, help="PDUs of each edition tried with the others (default 10000)"
    )
    parser.add_argument("--processes", type=int, default=2)
    for name, one in EVERY.items():
        parser.add_argument(f"--{name}", type=int, default=one, metavar="N", help=f"every N-th value; 0: none ({one})")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    raise SystemExit(main())
