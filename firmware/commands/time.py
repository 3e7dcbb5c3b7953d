"""captain time: shows station time, its source, its accuracy and its history."""

import argparse
import json
import math
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

from board.runtime.errors import StationError, UsageError
from firmware.client import client
from firmware.client.arguments import add_control, address
from firmware.client.show.sparkline import marks_for, sparkline
from firmware.client.show.status.clock import table
from firmware.client.show.table import Screen, Table, span
from firmware.client.show.time_record import Record, plain, record
from firmware.clock.time_history import SecondRow
from firmware.untrusted import within
from pps.allan import allan_deviation

DESCRIPTION = """\
Shows the time of a running station on this machine, its source and accuracy.
Sources are pulses of a receiver, its messages, or the system's clock. Also
shown: error of the system's clock, oscillator, leap seconds, refused pulses
with their reason, and chronyd.

Offset and jitter of the last hour are drawn as text, or as a picture.
"""
EPILOG = """\
examples:
  captain time
  captain time --watch                 every second, until Ctrl-C
  captain time --plot time.svg         offset, jitter and Allan deviation
  captain time --json | jq .state
  captain time --json --history | jq '.history.minutes[-1].offset_ns'

states:
  locked     set by pulses
  settling   first pulses received, a few more are needed
  holdover   no good pulse recently: the oscillator continues, the bound grows
  coarse     set by messages of a receiver, to about 0.2 s
  system     the system's clock alone, with its own error bound
  unknown    no source

exit codes:
  0    the station answered
  1    no station answers, or there is nothing to draw
  2    wrong usage
  130  Ctrl-C
"""
WATCH_S = 1.0
COLUMNS = 60  # characters of a sparkline
GAP = 3  # longest run of missing pulses that is interpolated; it is too short to change the deviation


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--json", action="store_true", help="one JSON object, as published under `time.`")
    parser.add_argument(
        "--history", action="store_true", help="with --json: add the last hour by seconds and the last day by minutes"
    )
    parser.add_argument("--watch", action="store_true", help="repeat every second")
    parser.add_argument("--plot", metavar="FILE.svg", help="draw offset, jitter and Allan deviation")
    add_control(parser)


def main(arguments: argparse.Namespace) -> int:
    """Show or draw the time of a station.

    Raises UsageError for options that exclude each other, and for a picture that is not SVG. Raises StationError
    without history, or if the picture cannot be written.
    """
    _check(arguments)
    if arguments.plot is not None:
        _plot(arguments)
        return 0
    if not arguments.watch:
        _show(_asked(arguments), arguments, None)
        return 0
    with Screen(all_by="captain time | less") as screen:
        while True:
            _show(_asked(arguments), arguments, screen)
            time.sleep(WATCH_S)


def _check(arguments: argparse.Namespace) -> None:
    """Check the combination of options. Raises UsageError if they exclude each other."""
    if arguments.plot is not None and (arguments.json or arguments.watch or arguments.history):
        raise UsageError("--plot draws once and prints nothing", "omit --json, --history and --watch")
    if arguments.history and not arguments.json:
        raise UsageError("--history needs --json", "add --json, or draw it with --plot")


def _asked(arguments: argparse.Namespace) -> dict[str, object]:
    """Return clock and history of the station. Raises StationError if no station answers."""
    is_whole = arguments.plot is not None or arguments.history
    answer = client.ask_local(address(arguments), arguments.control, "time", history=is_whole)
    return {key: within(answer, key) for key in ("clock", "history")}


def _show(answer: dict[str, object], arguments: argparse.Namespace, screen: Screen | None) -> None:
    clock, kept = within(answer, "clock"), record(within(answer, "history"))
    if arguments.json:
        history = {"seconds": plain(kept.seconds), "minutes": plain(kept.minutes)}
        print(json.dumps({**clock, **({"history": history} if arguments.history else {})}), flush=True)
        return
    (screen or Screen()).show([table(clock), *lines(kept, marks_for(sys.stdout))])


def _plot(arguments: argparse.Namespace) -> None:
    path = Path(arguments.plot)
    if path.suffix.lower() != ".svg":
        named = path.with_suffix(".svg") if path.name else "time.svg"
        raise UsageError(f"--plot: {arguments.plot!r}: a picture is SVG", f"name it {named}")
    answer = _asked(arguments)
    kept = record(within(answer, "history"))
    if len(kept.seconds) < 2:
        why = str(within(answer, "clock").get("missing") or "wait some seconds after the first pulse")
        raise StationError("no history of the station's time yet", why)
    from firmware.client.show.time_plot import picture  # imported on demand, because it loads pygal

    drawn = picture(kept, within(answer, "clock"), deviations(kept))
    try:
        path.write_text(drawn)
    except OSError as error:
        raise StationError(
            f"{path}: cannot be written: {error.strerror}", "name a file in a folder of yours"
        ) from error
    print(f"{path}: {len(kept.seconds)} seconds and {len(kept.minutes)} minutes")


def lines(kept: Record, marks: str) -> Iterator[Table]:
    """Yield a table with offset and jitter of the last hour as sparklines; nothing if there are too few values."""
    rows = kept.seconds
    if len(rows) < 2:
        return
    drawn = (
        ("offset", [row.offset_ns for row in rows]),
        ("jitter", [row.jitter_ns for row in rows]),
    )
    cells = [
        (name, sparkline(values, COLUMNS, marks), _between(values))
        for name, values in drawn
        if not all(map(math.isnan, values))
    ]
    if cells:
        yield Table(f"the last {span(rows[-1].its_s - rows[0].its_s)}", ("", "", "us"), cells)


def _between(values: Sequence[float]) -> str:
    known = [value / 1000 for value in values if not math.isnan(value)]
    return f"{min(known):.1f} .. {max(known):.1f}"


def deviations(kept: Record) -> list[tuple[float, float]]:
    """Return the Allan deviation of the oscillator as (tau in s, deviation): first from seconds, then from minutes."""
    found = allan_deviation(longest(kept.seconds, 1), 1.0)
    most_s = found[-1][0] if found else 0.0
    return found + [one for one in allan_deviation(longest(kept.minutes, 60), 60.0) if one[0] > most_s]


def longest(rows: Sequence[SecondRow], step_s: int) -> list[float]:
    """Return the phases of the longest series of pulses in ns, step_s apart.

    Up to GAP missing pulses in a row are interpolated.
    """
    best: list[float] = []
    found: list[float] = []
    before_s = -math.inf
    for row in rows:
        if math.isnan(row.phase_ns):
            continue
        elapsed_s, before_s = row.its_s - before_s, row.its_s
        if not found or elapsed_s not in range(step_s, (GAP + 1) * step_s + 1, step_s):
            found = []
        else:
            steps, last = int(elapsed_s) // step_s, found[-1]
            found += [last + (row.phase_ns - last) * part / steps for part in range(1, steps)]
        found.append(row.phase_ns)
        best = max(best, found, key=len)
    return best
