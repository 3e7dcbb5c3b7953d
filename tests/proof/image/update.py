"""Updates as people do them: from a web server, in 1970, refused ones, a version that fails and is left, and back.

The short form is one update of a box whose clock begins in 1970.
"""

import json
import re
import time
from collections.abc import Iterator
from pathlib import Path

from firmware.update.update import BEGUN
from tests.proof.image import bundles, refused
from tests.proof.image.bundles import GOOD, MARK, Bundles
from tests.proof.image.interrupt import left
from tests.proof.image.login import Key, new_key, said, wait_for_ssh
from tests.proof.image.machine import Guest, owned, powered
from tests.proof.image.root_shell import EXTRA, RootShell
from tests.proof.image.rows import Options, Row
from tests.proof.image.site import Site, serving
from tests.proof.image.slots import ENDED, INSTALL_S, WELL_S, seen, slots, status, update, well

BATTERYLESS = ("-rtc", "base=1970-01-01T00:00:00")
CLOCK = "captain status --json"


def rows(card: Path, folder: Path, options: Options) -> Iterator[Row]:
    began = time.monotonic()
    made = bundles.made(card, folder / "bundles", options.is_short)
    size_mb = made.good.stat().st_size / 1e6
    yield Row("bundles of the card's slot", f"{size_mb:.0f} MB, {time.monotonic() - began:.0f} s", "", True)
    key = new_key(folder)
    own = owned(card, folder, {"authorized_keys": key.line})
    with serving(made.good.parent) as site:
        shell = RootShell(folder)
        with powered(own, folder, [*BATTERYLESS, *shell.words]) as guest:
            guest.stop_loader(EXTRA)
            yield _first_start(guest, key)
            if not options.is_short:
                yield from _fresh(guest, key)
                yield from refused.rows(guest, key, shell, site, made, folder)
            yield from _good(guest, key, site, made)
            if options.is_short:
                yield Row("all of it", f"{time.monotonic() - began:.0f} s", "", True)
                return
            yield from _given_up(guest, key, site, made.broken, "whose station fails")
            yield from _given_up(guest, key, site, made.hanging, "whose start comes to no end")
            yield from _back(guest, key, site, made)
        yield from _after_power_cut(own, folder, key)
        yield from _tried_once_more(own, folder, key)


def _first_start(guest: Guest, key: Key) -> Row:
    guest.wait("slots: trying A, 2 tries left")
    wait_for_ssh(guest)
    year = said(guest, key, "date -u +%Y")
    return Row("the clock after a start in 1970", year, "the build's year", int(year or 0) >= 2024)


def _fresh(guest: Guest, key: Key) -> Iterator[Row]:
    yield well(guest, key, "A", "the factory's slot A")
    is_set = json.loads(said(guest, key, CLOCK) or "{}").get("is_clock_set")
    yield Row("is_clock_set, as nobody has set it", str(is_set).lower(), "false", is_set is False)


def _good(guest: Guest, key: Key, site: Site, made: Bundles) -> Iterator[Row]:
    site.breaks[made.good.name] = made.good.stat().st_size // 2
    ended = update(guest, key, f"--restart {site.url(made.good.name)}")
    yield Row("a good update, in 1970, broken off once", ended.last, "restarting now",
              ended.code == 0 and ended.last.endswith("restarting now"))  # fmt: skip
    parts = [wanted for name, wanted in site.asked if name == made.good.name][-2:]
    yield Row("the connection broke off in the middle", f"{parts}", "gone on with from there",
              len(parts) == 2 and bool(re.fullmatch(r"bytes=\d+-", parts[1])))  # fmt: skip
    yield Row("fetched, compared, installed", f"{ended.seconds:.0f} s", "", True)
    guest.wait("slots: trying B, 2 tries left")
    wait_for_ssh(guest)
    there = said(guest, key, f"cat /{MARK}")
    yield Row("the restart takes slot B", there or "the old version", "here", there == "here")
    yield well(guest, key, "B", "the new version in slot B")
    last = status(guest, key)["last"]
    yield Row("the last result, as --status tells it", f"{last.get('version')}: {last.get('result')}",
              f"{GOOD}: installed", (last.get("version"), last.get("result")) == (GOOD, "installed"))  # fmt: skip


def _given_up(guest: Guest, key: Key, site: Site, bundle: Path, what: str) -> Iterator[Row]:
    """Of an update to slot A that does not get well."""
    ended = update(guest, key, f"--restart {site.url(bundle.name)}")
    yield Row(f"an update {what}", ended.last, "restarting now", ended.code == 0)
    began = time.monotonic()
    for tries in (2, 1, 0):
        guest.wait(f"slots: trying A, {tries} tries left")
    guest.wait("slots: trying B, ")
    yield Row("slot A is tried three times, then B", f"{time.monotonic() - began:.0f} s", "by itself", True)
    wait_for_ssh(guest)
    yield well(guest, key, "B", "the version from before, in slot B")
    words = "failed its trial"
    for where, command in (("in --status", "captain update --status"), ("on the console", "cat /run/early")):
        shown = said(guest, key, command)
        yield Row(f"what is said of it {where}", words if words in shown else shown[-60:], words, words in shown)


def _back(guest: Guest, key: Key, site: Site, made: Bundles) -> Iterator[Row]:
    ended = update(guest, key, "--back")
    words = "slot A failed its trial"
    yield Row("--back to a slot that did not get well", seen(ended, words), words,
              ended.code == 1 and words in ended.words)  # fmt: skip
    yield from _left(guest, key, site, made)
    ended = update(guest, key, site.url(made.good.name))
    yield Row("another update, without a restart", ended.last, "is installed", ended.code == 0)
    ended = update(guest, key, "--restart")
    guest.wait("slots: trying A, 2 tries left")
    wait_for_ssh(guest)
    yield well(guest, key, "A", "slot A, well again")
    ended = update(guest, key, "--back --restart")
    guest.wait("slots: trying B, 2 tries left")
    wait_for_ssh(guest)
    yield well(guest, key, "B", "--back: slot B")


def _left(guest: Guest, key: Key, site: Site, made: Bundles) -> Iterator[Row]:
    """Ctrl-C while a slot is written: the service goes on, and nothing of that is lost."""
    gone = left(guest, key, f"captain update {site.url(made.good.name)}")
    words = "what is being written is written to its end"
    yield Row(f"Ctrl-C at {gone.percent} %: exit code {gone.code}", words if words in gone.last else gone.last, words,
              gone.code == 130 and words in gone.last)  # fmt: skip
    ended = update(guest, key, site.url(made.good.name))
    words = "another update is being installed"
    yield Row("a second one at once", seen(ended, words), words, ended.code == 1 and words in ended.words)
    ended = update(guest, key, "--restart")
    words = "the box is not restarted: another update is being installed"
    yield Row("--restart meanwhile", seen(ended, words), words, ended.code == 1 and words in ended.words)
    began = time.monotonic()
    while (result := str(status(guest, key)["last"].get("result"))) == BEGUN and time.monotonic() < began + INSTALL_S:
        time.sleep(1)
    slot = next(slot for slot in slots(guest, key) if not slot["is_booted"])
    ended_so = f"{result}, slot {slot['name']} {slot['words']}{', next' if slot['is_next'] else ''}"
    yield Row(f"how the first one ended, {time.monotonic() - began:.0f} s later", ended_so, "installed, next",
              result == "installed" and slot["is_next"] is True)  # fmt: skip


def _after_power_cut(card: Path, folder: Path, key: Key) -> Iterator[Row]:
    with powered(card, folder, BATTERYLESS) as guest:
        guest.wait("slots: trying B, 2 tries left")
        wait_for_ssh(guest)
        yield well(guest, key, "B", "the same after its power was cut")


def _tried_once_more(card: Path, folder: Path, key: Key) -> Iterator[Row]:
    """Of a slot that comes first and was well, and whose power goes each time before it is up."""
    for tries, words in (
        ((2, 1, 0), "slot B has no tries left and was known good: the next start tries it once more"),
        ((0,), "slot B failed once more: slot A comes first from now on"),
    ):
        for rest in tries:
            with powered(card, folder, BATTERYLESS) as guest:
                guest.wait(f"slots: trying B, {rest} tries left")
        with powered(card, folder, BATTERYLESS) as guest:
            guest.wait("slots: trying A, ")
            wait_for_ssh(guest)
            said(guest, key, ENDED, WELL_S)
            shown = said(guest, key, "cat /run/early")
            first = next(slot["name"] for slot in slots(guest, key) if slot["is_next"])
        yield Row(f"power that goes before slot B is up, times {len(tries)}", words if words in shown else shown[-100:],
                  words, words in shown)  # fmt: skip
    yield Row("the slot that comes first from then on", str(first), "A", first == "A")
