"""Station that cannot start, and its messages at login; an added library."""

import json
import re
from collections.abc import Iterator
from pathlib import Path

from image.tool import run
from tests.proof.image.login import Key, new_key, said, wait_for_ssh
from tests.proof.image.machine import Guest, owned, powered
from tests.proof.image.modules import CROSS
from tests.proof.image.root_shell import EXTRA, RootShell
from tests.proof.image.rows import Options, Row
from tests.proof.image.screen import HEAD, Screen
from tests.proof.image.user import user

SOURCES = Path(__file__).resolve().parents[3] / "drivers/sim/radio"
PORT = 5557  # which another program has
ITS_UNIT = "another-program"
TAKEN = f"systemd-run -q --unit={ITS_UNIT} systemd-socket-activate -l {PORT} cat; systemctl restart --no-block captain"
# Without a slot, which would be empty here: the library is loaded, and finds no module.
LIBRARY = "libeu_v2xcast.so"
RADIO = f'[station]\nname = "proof"\n\n[interfaces.air]\ndriver = "som301e"\nlibrary = "{LIBRARY}"\n'
OWN_WORDS = "V2Xcast service is not available"
DOCTOR = "captain doctor; echo ended with $?"


def rows(card: Path, folder: Path, _options: Options) -> Iterator[Row]:
    key = new_key(folder)
    files = {"authorized_keys": key.line, "captain.toml": RADIO, f"lib/{LIBRARY}": _library(folder)}
    own = owned(card, folder, files)
    shell = RootShell(folder)
    with powered(own, folder, shell.words) as guest:
        guest.stop_loader(EXTRA)
        screen = Screen(guest)
        screen.wait(HEAD)
        wait_for_ssh(guest)
        shell.open()
        with user(guest.ports) as one:
            one.heartbeat()
        yield from _well(guest, key)
        yield _radio(guest, key)
        shell.run(f"systemctl stop captain; {TAKEN}", 600)
        yield from _troubled(guest, key, screen)
        shell.run(f"systemctl stop {ITS_UNIT}.service")
        with user(guest.ports) as one:
            yield Row("once the port is free", f"heartbeat {one.heartbeat()}", "the station is back", True)
        shell.close()


def _well(guest: Guest, key: Key) -> Iterator[Row]:
    """Its modules, which this machine lacks, are problems; the station is none."""
    found = said(guest, key, DOCTOR, 600.0)
    for what, goal in (
        ("service", "captain.service is active (running)"),
        ("endpoint", ":: are the running"),
        ("board", "quad: "),
    ):
        told = _line(found, f"{what}:")
        yield Row(f"captain doctor, {what}", told, f"ok, {goal}", told.startswith("ok") and goal in told)


def _library(folder: Path) -> bytes:
    """The simulated radio's, with the calls of the maker's, for the card's processor."""
    made = folder / LIBRARY
    words = ["-std=c11", "-O2", "-shared", "-fPIC", "-fvisibility=hidden", "-pthread", "-o", str(made)]
    run([f"{CROSS}gcc", *words, *map(str, sorted(SOURCES.glob("*.c"))), "-lm"])
    return made.read_bytes()


def _radio(guest: Guest, key: Key) -> Row:
    """A library of the boot partition: where the station has it from, and what it says."""
    air = json.loads(said(guest, key, "captain status --json"))["interfaces"]["air"]
    found = f"{air['details'].get('library')}: {air['why']}"
    is_loaded = re.match(rf"/data/owner/[0-9a-f]+/lib/{LIBRARY}: ", found) and OWN_WORDS in found
    return Row("a maker's library of the boot partition", found, f"loaded: {OWN_WORDS}", bool(is_loaded))


def _troubled(guest: Guest, key: Key, screen: Screen) -> Iterator[Row]:
    words = screen.wait(f"(?s)its last words:.{{0,240}}{PORT}").group()
    yield Row("the console", " ".join(words.split()), f"the station's words of {PORT}", True)
    found = said(guest, key, DOCTOR, 600.0)
    told = re.search(r"^problem +service: .*(?:\n .*)*", found, re.MULTILINE)
    words = " ".join(told.group().split()) if told else "nothing of the service"
    is_told = "its last words: " in words and str(PORT) in words
    yield Row("captain doctor", words, f"a problem, and the words of {PORT}", is_told)
    status = said(guest, key, "captain status 2>&1")
    yield Row("captain status", status.replace("\n", " "), "names the service", "systemctl status captain" in status)


def _line(text: str, word: str) -> str:
    """The last one that has the word."""
    return next((line.strip()[:70] for line in reversed(text.splitlines()) if word in line), "nothing")
