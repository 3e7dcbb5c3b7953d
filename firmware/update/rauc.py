"""RAUC's service, called by its command: writes slots and counters."""

import json
import re
import subprocess
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from board.runtime.errors import StationError
from board.runtime.tool import environment
from firmware.update.reason import reason

PROGRAM = "rauc"
BUS = ("busctl", "--json=short", "get-property", "de.pengutronix.rauc", "/", "de.pengutronix.rauc.Installer")
ANSWER_S = 60.0
_STEP = re.compile(r"^\s*(\d{1,3})% (.*)$")
WRITES = ("Updating slots", "Copying image")  # RAUC's steps from which on it writes a slot
_BUSY = re.compile(r"lready processing|already in progress")
_FORBIDDEN = re.compile(r"AccessDenied|rejected send message|Permission denied|not allowed to")


class InstallError(StationError):
    """An installation started and failed."""


class BusyError(StationError):
    """RAUC's service is installing; meanwhile it starts nothing else and reports no slots."""

    def __init__(self) -> None:
        super().__init__("another update is being installed", "captain update --status shows its end")


def status(program: str = PROGRAM) -> Mapping[str, object]:
    """Return the service's status of the slots. Raises StationError on failure, BusyError while it installs."""
    said = _ask([program, "status", "--detailed", "--output-format=json"])
    try:
        found = json.loads(said)
    except ValueError as error:
        raise StationError(f"rauc status: unexpected output: {said[:80]!r}") from error
    return found if isinstance(found, dict) else {}


def activate(slot: str, program: str = PROGRAM) -> None:
    """Make a slot (rootfs.1) the first in boot order, with all tries. Raises StationError if rauc refuses."""
    _ask([program, "status", "mark-active", slot])


def idle() -> str:
    """Return the error of the last installation; empty after a success.

    Raises BusyError during an installation, started here or elsewhere. Raises StationError if the service does not
    answer.
    """
    operation, last_error = _properties("Operation", "LastError")
    if operation != "idle":
        raise BusyError
    return last_error


def _properties(*names: str) -> list[str]:
    said = _ask([*BUS, *names])
    try:
        found = [str(json.loads(line)["data"]) for line in said.splitlines()]
    except (ValueError, KeyError, TypeError) as error:
        raise StationError(f"the update service: unexpected output: {said[:80]!r}") from error
    if len(found) != len(names):
        raise StationError(f"the update service: unexpected output: {said[:80]!r}")
    return found


def install(path: Path, name: str, step: Callable[[int, str], None], program: str = PROGRAM) -> None:
    """Write a bundle into the other slot, and make that slot the next to boot.

    name  name that the user gave, for messages.
    step  called with each step: percent, and RAUC's description.

    Raises InstallError if writing failed, StationError if nothing was written. The service continues if this process
    ends.
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
        raise StationError("rauc is not installed: this machine is not a box") from error
    said, is_begun = [], False
    assert running.stdout
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
        return StationError(f"{name}: not installed: {why.words}", f"nothing was written; {why.hint}")
    return InstallError(f"{name}: {why.words}", why.hint)


def _ask(words: Sequence[str]) -> str:
    try:
        ended = subprocess.run(
            words, capture_output=True, text=True, errors="replace", timeout=ANSWER_S, check=False, env=environment()
        )
    except FileNotFoundError as error:
        raise StationError("rauc is not installed: this machine is not a box") from error
    except subprocess.TimeoutExpired as error:
        raise StationError(f"rauc: timeout after {ANSWER_S:.0f} s", "journalctl -u rauc") from error
    if ended.returncode == 0:
        return ended.stdout
    if _FORBIDDEN.search(ended.stderr):
        raise _forbidden()
    if _BUSY.search(ended.stderr):
        raise BusyError
    why = reason(ended.stderr)
    raise StationError(f"{words[0]}: {why.words}", why.hint)


def _forbidden() -> StationError:
    return StationError("this user may not update the box", "use operator, by ssh or at the serial console, or root")
