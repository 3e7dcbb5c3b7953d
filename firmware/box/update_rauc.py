"""RAUC's service, asked by its own command: it alone writes slots and counters, and lets root and operator ask."""

import json
import re
import subprocess
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from board.errors import StationError
from board.tool import environment
from firmware.box.update_reason import reason

PROGRAM = "rauc"
BUS = ("busctl", "--json=short", "get-property", "de.pengutronix.rauc", "/", "de.pengutronix.rauc.Installer")
ANSWER_S = 60.0
_STEP = re.compile(r"^\s*(\d{1,3})% (.*)$")
WRITES = ("Updating slots", "Copying image")  # steps from which on a slot is written
_BUSY = re.compile(r"lready processing|already in progress")
_FORBIDDEN = re.compile(r"AccessDenied|rejected send message|Permission denied|not allowed to")


class InstallError(StationError):
    """The service has begun to install, and has not come to a good end."""


class BusyError(StationError):
    """The service installs: it begins nothing else, and tells nothing of slots."""

    def __init__(self) -> None:
        super().__init__("another update is being installed", "captain update --status shows when it has ended")


def status(program: str = PROGRAM) -> Mapping[str, object]:
    """What the service says of slots. Raises StationError, BusyError while it installs."""
    said = _ask([program, "status", "--detailed", "--output-format=json"])
    try:
        found = json.loads(said)
    except ValueError as error:
        raise StationError(f"rauc status: is not understood: {said[:80]!r}") from error
    return found if isinstance(found, dict) else {}


def activate(slot: str, program: str = PROGRAM) -> None:
    """Have a slot (rootfs.1) be the first that is tried from now on, with all its tries. Raises StationError."""
    _ask([program, "status", "mark-active", slot])


def idle() -> str:
    """How its last installation ended: empty is well. Raises BusyError while one lasts, whoever has begun it."""
    operation, last_error = _properties("Operation", "LastError")
    if operation != "idle":
        raise BusyError
    return last_error


def _properties(*names: str) -> list[str]:
    said = _ask([*BUS, *names])
    try:
        found = [str(json.loads(line)["data"]) for line in said.splitlines()]
    except (ValueError, KeyError, TypeError) as error:
        raise StationError(f"the service of updates: is not understood: {said[:80]!r}") from error
    if len(found) != len(names):
        raise StationError(f"the service of updates: is not understood: {said[:80]!r}")
    return found


def install(path: Path, name: str, step: Callable[[int, str], None], program: str = PROGRAM) -> None:
    """Write a bundle into the other slot, and have that be tried next.

    name  what its user has named.
    step  is told each step: percent, and what is done, in RAUC's words.

    Raises InstallError, and StationError where nothing was begun. It goes on in the service if this process ends.
    """
    try:
        running = subprocess.Popen(
            [program, "install", str(path)],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
            env=environment(),
        )
    except FileNotFoundError as error:
        raise StationError("rauc is not installed: this is no box that can be updated") from error
    said, is_begun = [], False
    assert running.stdout is not None
    with running:
        for line in running.stdout:
            if found := _STEP.match(line):
                is_begun = is_begun or found[2].startswith(WRITES)
                step(int(found[1]), found[2].strip())
            said.append(line)
    if running.returncode:
        raise _failed(name, "".join(said[-40:]), is_begun)


def _failed(name: str, said: str, is_begun: bool) -> StationError:
    if _FORBIDDEN.search(said):
        return _forbidden()
    if _BUSY.search(said):
        return BusyError()
    why = reason(said)
    if not is_begun:
        return StationError(f"{name}: was not installed: {why.words}", f"nothing was written; {why.hint}")
    return InstallError(f"{name}: {why.words}", why.hint)


def _ask(words: Sequence[str]) -> str:
    try:
        ended = subprocess.run(
            words, capture_output=True, text=True, errors="replace", timeout=ANSWER_S, check=False, env=environment()
        )
    except FileNotFoundError as error:
        raise StationError("rauc is not installed: this is no box that can be updated") from error
    except subprocess.TimeoutExpired as error:
        raise StationError(f"rauc does not answer within {ANSWER_S:.0f} s", "journalctl -u rauc") from error
    if ended.returncode == 0:
        return ended.stdout
    if _FORBIDDEN.search(ended.stderr):
        raise _forbidden()
    if _BUSY.search(ended.stderr):
        raise BusyError
    why = reason(ended.stderr)
    raise StationError(f"{words[0]}: {why.words}", why.hint)


def _forbidden() -> StationError:
    return StationError("this user may not update the box", "operator may, by ssh or at the serial console, and root")
