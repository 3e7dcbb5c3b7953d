"""captain update: installs another version of the box's software in the other slot."""

import argparse
import io
import json
import signal
import sys
import time
from collections.abc import Callable, Mapping

from board.runtime.errors import UsageError
from firmware import VERSION
from firmware.client.show.table import Table, lines_for
from firmware.printable import clean, failure, folded
from firmware.update import bundle as update_bundle
from firmware.update import health, update
from firmware.update.bundle import Bundle
from firmware.update.folder import Folder
from firmware.update.rauc import BusyError, InstallError
from firmware.update.slots import AS_WRITTEN, RootSlot, booted, other
from firmware.usage import print_json

HALF_WRITTEN = 3
UNTOUCHED = "no slot was changed"
ITS_END = "the write that has begun is finished; captain update --status shows its end"
EVERY_PERCENT = 10
EVERY_S = 5.0

DESCRIPTION = """\
Installs a bundle, captain-VERSION-arm64.raucb, into the other slot while the
box works on. Shows its contents, and checks signature and contents before
anything is written. The next start uses the new slot. If its station fails
three starts, the old slot starts again.

FILE is a bundle on the box, URL one of a web server (http:// or https://; an
interrupted download resumes), and - reads standard input. Only for operator,
by ssh or at the serial console, and for root.
"""
EPILOG = """\
examples:
  captain update https://example.org/captain-0.7.0-arm64.raucb --restart
  captain update --look captain.raucb     show its contents; write nothing
  ssh operator@captain.local captain update - --restart < captain.raucb
                                          from a laptop, without a copy first
  captain update --status                 both slots, and the last update's result
  captain update --back --restart         the version before

exit codes:
  0    installed, shown or switched; --check: the station works
  1    rejected, or the download failed: no slot was changed
  2    wrong usage
  3    failed while writing: the other slot is unusable until the next update;
       this one stays in use
  130  Ctrl-C; a write that has begun is finished
"""


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("source", nargs="?", metavar="FILE|URL|-", help="the bundle")
    parser.add_argument("--restart", action="store_true", help="restart the box afterwards; alone: now")
    verbs = parser.add_mutually_exclusive_group()
    verbs.add_argument("--look", action="store_true", help="show and check the bundle; write nothing")
    verbs.add_argument("--status", action="store_true", help="show the slots: versions, tries left, last result")
    verbs.add_argument("--back", action="store_true", help="use the other slot at the next start")
    verbs.add_argument("--check", action="store_true", help="wait until the station works, as a slot on trial must")
    parser.add_argument("--json", action="store_true", help="with --status: one JSON object")


def main(arguments: argparse.Namespace) -> int:
    """Update the box, or show its slots. Raises UsageError for options that exclude each other."""
    is_other = arguments.status or arguments.back or arguments.check
    if is_other == bool(arguments.source) and (is_other or not arguments.restart):
        raise UsageError("name a bundle, or one of --status, --back and --check", "captain update --help")
    if arguments.restart and (arguments.status or arguments.check or arguments.look):
        raise UsageError("--restart goes with an update, with --back, or alone", "captain update --help")
    if arguments.look and not arguments.source:
        raise UsageError("--look: name a bundle", "captain update --look FILE")
    if arguments.check:
        update_bundle.demand_box()
        print(health.check(), flush=True)
        return 0
    if arguments.status:
        _status(arguments.json)
        return 0
    if arguments.back:
        chosen = update.back()
        _told(f"the next start uses slot {chosen.name}, {_version(chosen)}", arguments.restart)
        return 0
    if not arguments.source:
        update_bundle.demand_box()
        _restart()
        return 0
    return _install(arguments)


def _install(arguments: argparse.Namespace) -> int:
    signal.signal(signal.SIGHUP, signal.SIG_IGN)  # a begun installation is completed, even if the terminal hangs up
    teller = Teller()
    progress = update.Progress(teller.step, teller.fetched, _shown, teller.begun)
    try:
        found = update.run(arguments.source, progress, only_look=arguments.look)
    except InstallError as error:
        _say(f"captain: {failure(error)}", is_wrong=True)
        _say("  (the other slot is unusable until the next update; this one stays in use)", is_wrong=True)
        if arguments.json:
            print_json(error)
        return HALF_WRITTEN
    except KeyboardInterrupt:
        _say(f"captain: {ITS_END if teller.is_begun else UNTOUCHED}", is_wrong=True)
        raise
    if arguments.look:
        _say("signature and contents are valid; nothing was written")
        return 0
    _told(f"version {clean(found.version)} is installed; the next start uses it", arguments.restart)
    return 0


def _told(what: str, is_restarting: bool) -> None:
    if is_restarting:
        _say(what)
        _restart()
    else:
        _say(f"{what}; restart the box: captain update --restart")


def _restart() -> None:
    with update.undisturbed():
        _say("restarting now")
        update.restart()


def _say(line: str, is_wrong: bool = False) -> None:
    """Print a line. Once its reader has gone, discard all further output to this stream."""
    try:
        stream = sys.stderr if is_wrong else sys.stdout
        print(folded(line, stream), file=stream, flush=True)
    except OSError:
        setattr(sys, "stderr" if is_wrong else "stdout", io.StringIO())


def _shown(bundle: Bundle, slots: list[RootSlot]) -> None:
    here, there = booted(slots), other(slots)
    _say(
        f"version     {clean(bundle.version)}, built {clean(bundle.build)}; slot {here.name} runs {VERSION}\n"
        f"for         {clean(bundle.compatible)}\n"
        f"size        {bundle.size / 1e6:.1f} MB, {bundle.written / 1e6:.0f} MB on the card\n"
        f"signed by   {clean(bundle.signer)}\n"
        f"goes into   slot {there.name}, in place of {_version(there)}"
    )


def _version(slot: RootSlot) -> str:
    return "the card's original version" if slot.version == AS_WRITTEN else f"version {clean(slot.version)}"


class Teller:
    """Progress for a terminal without cursor control: a line every ten percent, and at the start of each step."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self.is_begun = False  # the installing service has taken over the bundle
        self._clock = clock
        self._said: tuple[str, int] = ("", -EVERY_PERCENT)
        self._at = 0.0

    def begun(self) -> None:
        self.is_begun = True

    def step(self, percent: int, what: str) -> None:
        name = what.split(" ", 1)[0]
        if name != self._said[0] or percent >= self._said[1] + EVERY_PERCENT or percent == 100 != self._said[1]:
            self._said = (name, percent)
            _say(f"{percent:3d} %  {clean(what)}")

    def fetched(self, have: int, size: int) -> None:
        if size:
            self.step(100 * have // size, f"fetching, {have / 1e6:.0f} of {size / 1e6:.0f} MB")
        elif self._clock() >= self._at + EVERY_S:
            self._at = self._clock()
            _say(f"       fetching, {have / 1e6:.0f} MB")


def _status(is_json: bool) -> None:
    own = update_bundle.box()
    try:
        slots = update.slots()
    except BusyError:
        slots = []
    last = update.last(Folder())
    if is_json:
        told = {"slots": [slot._asdict() | {"words": slot.words} for slot in slots], "last": last, "takes": own.takes}
        print(json.dumps(told | {"compatible": own.compatible}), flush=True)
        return
    rows = [
        (
            slot.name,
            "runs" if slot.is_booted else "",
            "next" if slot.is_next else "",
            slot.version,
            slot.installed or "-",
            "?" if slot.left is None else str(slot.left),
        )
        for slot in slots
    ]
    notes = [f"{slot.name}: {slot.words}" for slot in slots]  # 80 columns have no room for a column of texts
    notes += [f"this is {own.takes}"] if own.takes else []
    notes += [] if slots else ["an update is being installed: slots are shown after its end"]
    notes.append(_last(last))
    table = Table("slots", ("slot", "", "", "version", "installed", ">tries"), rows, notes)
    print("\n".join(lines_for(table, sys.stdout)), flush=True)


def _last(last: Mapping[str, object]) -> str:
    """Return the result of the last update as text."""
    if not last:
        return "no update recorded"
    try:
        when = time.strftime("%Y-%m-%d %H:%M", time.gmtime(float(str(last["time"]))))
    except (KeyError, ValueError, OverflowError, OSError):
        when = "at an unknown time"
    version = f", version {clean(str(last.get('version')))}" if last.get("version") else ""
    return f"last update, {when} UTC, {clean(str(last.get('source')))}{version}: {clean(str(last.get('result')))}"
