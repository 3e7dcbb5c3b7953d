"""Updates that a box refuses, with the reason in words; its slots and counters stay as they were."""

import ssl
from collections.abc import Iterator
from pathlib import Path

from tests.broker.certificates import Authority
from tests.proof.image.bundles import Bundles
from tests.proof.image.login import Key, said, ssh
from tests.proof.image.machine import Guest
from tests.proof.image.root_shell import RootShell
from tests.proof.image.rows import Row
from tests.proof.image.site import HOST, Site, serving
from tests.proof.image.slots import INSTALL_S, counters, seen, update

# What is said of each, in part.
REFUSALS = {
    "another signer": "unknown signer",
    "another device tree": "this box is '",
    "signature changed": "invalid signature: it was changed or damaged",
    "contents changed": "its contents do not match its signature",
    "truncated": "not a bundle, or truncated",
}
UNPROVEN = "is on trial"
# As somebody would who knows RAUC, and not captain update.
RAUC_INSTALL = "own=/data/update/own.raucb; cat >$own && rauc install $own; code=$?; rm $own; exit $code"


def rows(guest: Guest, key: Key, shell: RootShell, site: Site, made: Bundles, folder: Path) -> Iterator[Row]:
    """shell: root's, not yet open."""
    yield from _refused(guest, key, site, made, folder)
    shell.open()
    yield from _forbidden(shell)
    yield from _unproven(guest, key, shell, site, made)
    shell.close()


def _refused(guest: Guest, key: Key, site: Site, made: Bundles, folder: Path) -> Iterator[Row]:
    before = counters(guest, key)
    for kind, words in REFUSALS.items():
        ended = update(guest, key, site.url(made.spoiled[kind].name))
        is_ok = ended.code == 1 and words in ended.words
        yield Row(f"refused: {kind}, {ended.seconds:.0f} s", seen(ended, words), words[:40], is_ok)
    for what, source, words in (
        ("no such file on the server", site.url("none.raucb"), "the server has no such file"),
        ("nobody at the address", f"http://{HOST}:9/x.raucb", "refuses the connection"),
        ("no such file on the box", "/data/update/none.raucb", "No such file"),
    ):
        ended = update(guest, key, source)
        yield Row(f"refused: {what}", seen(ended, words), words, ended.code == 1 and words in ended.words)
    yield _untrusted(guest, key, made, folder)
    yield _full(guest, key, site, made)
    after = counters(guest, key)
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
    words = "unknown authority"
    return Row("refused: https of an unknown authority", seen(ended, words), words,
               ended.code == 1 and words in ended.words)  # fmt: skip


def _full(guest: Guest, key: Key, site: Site, made: Bundles) -> Row:
    """/data filled by operator's own file, as recordings would."""
    said(guest, key, "fallocate -l $(($(df --output=avail -B1 /data | tail -n 1) - 30000000)) /data/update/recording")
    ended = update(guest, key, site.url(made.good.name))
    said(guest, key, "rm /data/update/recording")
    words = "no room"
    return Row("refused: no room on /data", seen(ended, words), words, ended.code == 1 and words in ended.words)


def _forbidden(shell: RootShell) -> Iterator[Row]:
    """What the station's user, whom the network talks to, reaches of updates."""
    asked = "busctl call de.pengutronix.rauc / de.pengutronix.rauc.Installer GetSlotStatus >/dev/null"
    for user, words in (("captain", "Access denied"), ("_chrony", "Access denied"), ("operator", "")):
        heard = shell.run(f"setpriv --reuid {user} --regid {user} --init-groups {asked}")
        yield Row(f"RAUC's service, asked by {user}", heard.splitlines()[-1] if heard else "answers",
                  words or "answers", words in heard if words else not heard)  # fmt: skip
    heard = shell.run("setpriv --reuid captain --regid captain --init-groups captain update --restart")
    yield Row("a restart, asked for by captain", heard.splitlines()[-2][-40:] if "\n" in heard else heard,
              "Permission denied", "Permission denied" in heard)  # fmt: skip


def _unproven(guest: Guest, key: Key, shell: RootShell, site: Site, made: Bundles) -> Iterator[Row]:
    """Of a slot that was updated and has not been well yet: the other one, which was, is overwritten by no way."""
    shell.run("fw_setenv BOOT_NEW A")
    before = counters(guest, key)
    ended = update(guest, key, site.url(made.sound.name))
    yield Row("an update from an unproven slot", seen(ended, UNPROVEN), UNPROVEN,
              ended.code == 1 and UNPROVEN in ended.words)  # fmt: skip
    asked = ssh(guest, key.path, RAUC_INSTALL, INSTALL_S, made.sound)
    words = shell.run(f"journalctl -u rauc -o cat | grep '{UNPROVEN}'")
    yield Row("the same, asked of the service itself", f"{asked.returncode}: {words[-60:]}", UNPROVEN,
              asked.returncode == 1 and UNPROVEN in words)  # fmt: skip
    after = counters(guest, key)
    yield Row("boot counters after both", "as before" if after == before else f"{after}", "as before", after == before)
    shell.run("fw_setenv BOOT_NEW 0")
