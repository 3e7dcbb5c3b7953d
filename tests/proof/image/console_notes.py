"""Console notes on the owner's files, and access to the box after."""

import os
import re
import subprocess
from collections.abc import Iterator, Mapping
from pathlib import Path

from tests.proof.image.login import Key, said, wait_for_ssh
from tests.proof.image.machine import Guest, partition_offset
from tests.proof.image.rows import Row
from tests.proof.image.screen import HEAD, Screen
from tests.proof.image.user import user

NEXT = re.compile(r"next page \((\d+)\)")


def notes(guest: Guest) -> str:
    """All pages of the serial console. Its notes are complete once the station is there."""
    screen = Screen(guest)
    screen.wait(HEAD)
    shown = [screen.settle()]
    while (following := NEXT.search(shown[-1])) and following[1] != "1":
        screen.type("n")
        screen.wait(rf"page {following[1]}/")
        shown.append(screen.settle())
    return "\n".join(shown)


def told(shown: str, what: str, words: str) -> Row:
    is_there = "".join(words.split()) in "".join(shown.split())
    return Row(what, words[:40] if is_there else "not on the serial console", "told", is_there)


def all_told(shown: str, wanted: Mapping[str, str]) -> Iterator[Row]:
    """Words by what they are about."""
    return (told(shown, what, words) for what, words in wanted.items())


def reachable(guest: Guest, key: Key, name: str, when: str) -> Iterator[Row]:
    with user(guest.ports) as one:
        number = one.heartbeat()
    yield Row(f"the endpoint, {when}", f"heartbeat {number}", "answers", True)
    wait_for_ssh(guest)
    found = said(guest, key, "id -un; hostname")
    yield Row(
        f"ssh, {when}", found.replace("\n", " at ") or "refused", f"operator at {name}", found == f"operator\n{name}"
    )


def taken_away(card: Path, *names: str) -> None:
    """Files away from the boot partition, where they are there."""
    words = ["mdel", "-i", f"{card}@@{partition_offset(card)}"]
    environment = {**os.environ, "MTOOLS_SKIP_CHECK": "1"}
    for name in names:
        subprocess.run([*words, f"::{name}"], env=environment, stderr=subprocess.DEVNULL, check=False)
