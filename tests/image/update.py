"""Updates as people do them: from a web server, in 1970, refused ones, a version that fails and is left, and back.

The short form is one update of a box whose clock begins in 1970.
"""

import json
import re
import ssl
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from tests.broker.certificates import Authority
from tests.image import bundles
from tests.image.bundles import GOOD, MARK, Bundles
from tests.image.login import Key, new_key, said, ssh, wait_for_ssh
from tests.image.machine import Guest, NotSeenError, owned, powered
from tests.image.root_shell import EXTRA, RootShell
from tests.image.rows import Options, Row
from tests.image.site import HOST, Site, serving

BATTERYLESS = ("-rtc", "base=1970-01-01T00:00:00")
INSTALL_S = 900.0
WELL_S = 900.0
# What is said of each, in part.
REFUSALS = {
    "another signer": "signed by somebody whom this box does not know",
    "another device tree": "and this box is '",
    "signature changed": "signature does not fit: it was changed or damaged",
    "contents changed": "its contents are not what was signed",
    "truncated": "is no bundle, or not all of one",
}
CLOCK = "captain status --json"
# The start is over, and the check of the slot has ended.
ENDED = (
    "systemctl is-system-running --wait >/dev/null; "
    "until systemctl show -P ActiveState captain-good | grep -Eqx 'inactive|failed'; do sleep 1; done"
)


class Ended(NamedTuple):
    """A command of operator. words: both outputs."""

    code: int
    words: str
    seconds: float

    @property
    def last(self) -> str:
        return self.words.strip().splitlines()[-1][:100] if self.words.strip() else ""


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
                yield from _refused(guest, key, site, made, folder)
                yield from _forbidden(shell)
            yield from _good(guest, key, site, made)
            if options.is_short:
                yield Row("all of it", f"{time.monotonic() - began:.0f} s", "", True)
                return
            yield from _broken(guest, key, site, made)
            yield from _back(guest, key, site, made)
        yield from _after_power_cut(own, folder, key)


def _first_start(guest: Guest, key: Key) -> Row:
    guest.wait("slots: trying A, 2 tries left")
    wait_for_ssh(guest)
    year = said(guest, key, "date -u +%Y")
    return Row("the clock after a start in 1970", year, "the build's year", int(year or 0) >= 2024)


def _fresh(guest: Guest, key: Key) -> Iterator[Row]:
    yield _well(guest, key, "A", "the factory's slot A")
    is_set = json.loads(said(guest, key, CLOCK) or "{}").get("is_clock_set")
    yield Row("is_clock_set, as nobody has set it", str(is_set).lower(), "false", is_set is False)


def _refused(guest: Guest, key: Key, site: Site, made: Bundles, folder: Path) -> Iterator[Row]:
    before = _counters(guest, key)
    for kind, words in REFUSALS.items():
        ended = update(guest, key, site.url(made.spoiled[kind].name))
        is_ok = ended.code == 1 and words in ended.words
        yield Row(f"refused: {kind}, {ended.seconds:.0f} s", _words(ended, words), words[:40], is_ok)
    for what, source, words in (
        ("no such file on the server", site.url("none.raucb"), "the server has no such file"),
        ("nobody at the address", f"http://{HOST}:9/x.raucb", "nobody listens there"),
        ("no such file on the box", "/data/update/none.raucb", "No such file"),
    ):
        ended = update(guest, key, source)
        yield Row(f"refused: {what}", _words(ended, words), words, ended.code == 1 and words in ended.words)
    yield _untrusted(guest, key, made, folder)
    yield _full(guest, key, site, made)
    after = _counters(guest, key)
    yield Row("boot counters after all of these", "as before" if after == before else f"{after}", "as before",
              after == before)  # fmt: skip


def _untrusted(guest: Guest, key: Key, made: Bundles, folder: Path) -> Row:
    """By TLS, of an authority that the image does not have; its certificates are of now, and the clock is not."""
    place = folder / "authority"
    place.mkdir()
    pair = Authority(place).server((f"IP:{HOST}",))
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(pair.certificate, pair.key)
    with serving(made.good.parent, context) as site:
        ended = update(guest, key, site.url(made.good.name))
    words = "authority that is not known here"
    return Row("refused: https of an unknown authority", _words(ended, words), words,
               ended.code == 1 and words in ended.words)  # fmt: skip


def _full(guest: Guest, key: Key, site: Site, made: Bundles) -> Row:
    """/data filled by operator's own file, as recordings would."""
    said(guest, key, "fallocate -l $(($(df --output=avail -B1 /data | tail -n 1) - 30000000)) /data/update/recording")
    ended = update(guest, key, site.url(made.good.name))
    said(guest, key, "rm /data/update/recording")
    words = "has room for"
    return Row("refused: no room on /data", _words(ended, words), words, ended.code == 1 and words in ended.words)


def _forbidden(shell: RootShell) -> Iterator[Row]:
    """What the station's user, whom the network talks to, reaches of updates."""
    shell.open()
    asked = "busctl call de.pengutronix.rauc / de.pengutronix.rauc.Installer GetSlotStatus >/dev/null"
    for user, words in (("captain", "Access denied"), ("_chrony", "Access denied"), ("operator", "")):
        heard = shell.run(f"setpriv --reuid {user} --regid {user} --init-groups {asked}")
        yield Row(f"RAUC's service, asked by {user}", heard.splitlines()[-1] if heard else "answers",
                  words or "answers", words in heard if words else not heard)  # fmt: skip
    heard = shell.run("setpriv --reuid captain --regid captain --init-groups captain update --restart")
    yield Row("a restart, asked for by captain", heard.splitlines()[-2][-40:] if "\n" in heard else heard,
              "Permission denied", "Permission denied" in heard)  # fmt: skip
    shell.close()


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
    yield _well(guest, key, "B", "the new version in slot B")
    last = _status(guest, key)["last"]
    yield Row("the last result, as --status tells it", f"{last.get('version')}: {last.get('result')}",
              f"{GOOD}: installed", (last.get("version"), last.get("result")) == (GOOD, "installed"))  # fmt: skip


def _broken(guest: Guest, key: Key, site: Site, made: Bundles) -> Iterator[Row]:
    ended = update(guest, key, f"--restart {site.url(made.broken.name)}")
    yield Row("an update whose station fails", ended.last, "restarting now", ended.code == 0)
    began = time.monotonic()
    for left in (2, 1, 0):
        guest.wait(f"slots: trying A, {left} tries left")
    guest.wait("slots: trying B, ")
    yield Row("slot A is tried three times, then B", f"{time.monotonic() - began:.0f} s", "by itself", True)
    wait_for_ssh(guest)
    yield _well(guest, key, "B", "the version from before, in slot B")
    shown = said(guest, key, "captain update --status; cat /run/early")
    words = ("was updated and did not get well", "slot A was updated and did not get well")
    yield Row("what is said of it, in --status and on the console", "both" if all(map(shown.__contains__, words))
              else shown[-60:], "both", all(map(shown.__contains__, words)))  # fmt: skip


def _back(guest: Guest, key: Key, site: Site, made: Bundles) -> Iterator[Row]:
    ended = update(guest, key, "--back")
    words = "slot A was updated and did not get well"
    yield Row("--back to a slot that did not get well", _words(ended, words), words,
              ended.code == 1 and words in ended.words)  # fmt: skip
    ended = update(guest, key, site.url(made.good.name))
    yield Row("another update, without a restart", ended.last, "is installed", ended.code == 0)
    ended = update(guest, key, "--restart")
    guest.wait("slots: trying A, 2 tries left")
    wait_for_ssh(guest)
    yield _well(guest, key, "A", "slot A, well again")
    ended = update(guest, key, "--back --restart")
    guest.wait("slots: trying B, 2 tries left")
    wait_for_ssh(guest)
    yield _well(guest, key, "B", "--back: slot B")


def _after_power_cut(card: Path, folder: Path, key: Key) -> Iterator[Row]:
    with powered(card, folder, BATTERYLESS) as guest:
        guest.wait("slots: trying B, 2 tries left")
        wait_for_ssh(guest)
        yield _well(guest, key, "B", "the same after its power was cut")


def update(guest: Guest, key: Key, words: str, limit_s: float = INSTALL_S) -> Ended:
    """captain update, by operator over ssh."""
    began = time.monotonic()
    ended = ssh(guest, key.path, f"captain update {words}", limit_s)
    return Ended(ended.returncode, ended.stdout + ended.stderr, time.monotonic() - began)


def _status(guest: Guest, key: Key) -> dict[str, dict[str, object]]:
    ended = ssh(guest, key.path, "captain update --status --json")
    try:
        found: dict[str, dict[str, object]] = json.loads(ended.stdout)
    except ValueError as error:
        raise NotSeenError(f"captain update --status says {ended.stdout + ended.stderr!r}") from error
    return found


def _counters(guest: Guest, key: Key) -> list[tuple[object, ...]]:
    return [(slot["name"], slot["left"], slot["is_new"], slot["is_next"]) for slot in _slots(guest, key)]


def _slots(guest: Guest, key: Key) -> list[dict[str, object]]:
    return list(_status(guest, key)["slots"])  # type: ignore[arg-type]


def _well(guest: Guest, key: Key, name: str, what: str) -> Row:
    """Once the check of the slot has ended: all tries are back, and it is not new any more."""
    began = time.monotonic()
    said(guest, key, ENDED, WELL_S)
    slot = next(slot for slot in _slots(guest, key) if slot["name"] == name)
    seen = f"{slot['words']}, {slot['left']} tries, {'runs' if slot['is_booted'] else 'does not run'}"
    is_ok = (slot["words"], slot["left"], slot["is_booted"]) == ("well", 3, True)
    took = f" (+{time.monotonic() - began:.0f} s)"
    return Row(what, seen + took, "well, 3 tries, runs", is_ok)


def _words(ended: Ended, wanted: str) -> str:
    return wanted if wanted in ended.words else f"{ended.code}: {ended.last}"
