"""Service of the station in systemd: options, state and last error.

They are read from systemd itself and not from unit files, so that drop-ins and environment files are included.
"""

import json
import os
import re
import shlex
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path

from board.runtime.tool import environment

UNIT = "captain.service"
MANAGER = Path("/run/systemd/system")  # this folder exists if systemd runs: sd_booted(3)
FOLDERS = tuple(map(Path, ("/etc/systemd/system", "/run/systemd/system", "/usr/lib/systemd/system")))
SHOW = (
    "systemctl",
    "show",
    UNIT,
    "--property=LoadState,ActiveState,SubState,Result,NRestarts,ExecMainStatus,ExecStart,Environment,EnvironmentFiles,"
    "WorkingDirectory",
)
# Command that prints log messages of the unit's own processes, but not those of systemd about the unit.
SAID = (
    "journalctl",
    "--quiet",
    "--no-pager",
    "--boot",
    "--lines=50",
    "--output=json",
    "--output-fields=MESSAGE",
    f"_SYSTEMD_UNIT={UNIT}",
)
LIMIT_S = 5.0  # time limit of a command; each of the two takes 0.1 s
# Folder of an environment file that only the image's unit uses.
IMAGE = "/run/captain-image/"
ARGV = re.compile(r"argv\[\]=(.*?) ; ignore_errors=")
VARIABLE = re.compile(r"\$\{(\w+)\}")
# Beginning of log lines that cannot be the cause for an end of the station.
QUIET = re.compile(r"[\w.]+: (?:DEBUG|INFO|WARNING): ")
MOST = 400  # largest number of characters of the last error

ASK_IT = "the station is a service: `systemctl status captain` shows its state, `captain doctor` the remedy"
CORRECT_CARD = (
    "correct captain.toml on the card's first partition, check it by `captain box check` on that computer, and start "
    "the box with it"
)
RESTART_BOX = "`captain update --restart` restarts the box"

Unit = Mapping[str, str]  # properties of a loaded unit, as `systemctl show` prints them


def is_installed() -> bool:
    """Return True if the station is installed as a systemd service on this machine."""
    return MANAGER.exists() and any((folder / UNIT).exists() for folder in FOLDERS)


def ask() -> Unit | None:
    """Return the properties of the station's unit; None if systemd does not run or has not loaded the unit."""
    return read(_said(SHOW)) if MANAGER.exists() else None


def journal() -> str:
    """Return the last log messages of the service, for last_words()."""
    return _said(SAID)


def read(shown: str) -> Unit | None:
    """Parse the output of SHOW. Return None if the unit is not loaded."""
    found: dict[str, str] = {}
    for line in shown.splitlines():
        key, _, value = line.partition("=")
        found[key] = f"{found[key]}\n{value}" if key in found else value  # EnvironmentFiles has one line per file
    return found if found.get("LoadState") == "loaded" else None


# -- options of the service


def options(unit: Unit) -> list[str]:
    """Return the arguments after `captain run` in the unit, with environment variables replaced.

    ${X} is replaced within a word; $X may be replaced by several words (systemd.service(5)).
    """
    found = ARGV.search(unit.get("ExecStart", ""))
    _, _, given = (found[1] if found else "").partition(" run ")
    known = _environment(unit)
    words: list[str] = []
    for word in given.split():
        words += known.get(word[1:], "").split() if re.fullmatch(r"\$\w+", word) else [_replaced(word, known)]
    return words


def folder(unit: Unit) -> str:
    """Return the working directory of the service; `/` if it is missing or not accessible."""
    # A leading `-` permits a missing directory. Then, and by default, systemd uses the root directory.
    wanted = unit.get("WorkingDirectory", "").lstrip("!-")
    return wanted if os.path.isdir(wanted) and os.access(wanted, os.X_OK) else "/"


def is_box(unit: Unit) -> bool:
    """Return True if the unit is that of the image, whose user cannot become root."""
    return IMAGE in unit.get("EnvironmentFiles", "")


def _replaced(word: str, known: Mapping[str, str]) -> str:
    return VARIABLE.sub(lambda found: known.get(found[1], ""), word)


def _environment(unit: Unit) -> dict[str, str]:
    words = shlex.split(unit.get("Environment", ""))
    for line in unit.get("EnvironmentFiles", "").splitlines():
        path = line.rpartition(" (ignore_errors")[0]
        try:
            words += shlex.split(Path(path).read_text(), comments=True)
        except (OSError, ValueError):
            continue  # an optional file may be missing; systemd itself reports unreadable ones
    pairs = (word.partition("=") for word in words)
    return {key: value for key, _, value in pairs}


# -- state of the service


def state(unit: Unit) -> str:
    """Return the state of the service, its last result and its restarts as text."""
    active, sub, result = unit.get("ActiveState", ""), unit.get("SubState", ""), unit.get("Result", "")
    parts = [f"{UNIT} is {active}" + (f" ({sub})" if sub not in ("", active) else "")]
    if result not in ("", "success"):
        status = unit.get("ExecMainStatus", "0")
        parts.append(f"its last run: {result}{f' {status}' if status != '0' else ''}")
    if restarts(unit):
        parts.append(f"started again {restarts(unit)} times")
    return ", ".join(parts)


def restarts(unit: Unit) -> int:
    """Return the number of automatic restarts by systemd."""
    count = unit.get("NRestarts", "")
    return int(count) if count.isdecimal() else 0


def is_active(unit: Unit) -> bool:
    return unit.get("ActiveState") in ("active", "reloading")


def remedy(unit: Unit) -> str:
    """Return the remedy for a service that is not active or that fails repeatedly."""
    if unit.get("ActiveState") == "inactive":
        return RESTART_BOX if is_box(unit) else f"it is started by `systemctl start {UNIT}`"
    if unit.get("ActiveState") == "activating" and not restarts(unit):
        return "it is starting: check again in a minute"
    return CORRECT_CARD if is_box(unit) else f"correct {_configuration(unit)}, then `systemctl restart {UNIT}`"


def _configuration(unit: Unit) -> str:
    words = options(unit)
    return words[words.index("--config") + 1] if "--config" in words[:-1] else "its configuration"


def last_words(said: str) -> str:
    """Return the last error of the station with its hint; empty without an error.

    said  output of SAID: one JSON object per line and message.
    """
    lines = [*filter(None, map(_message, said.splitlines()))]
    for at in range(len(lines) - 1, -1, -1):
        if not (lines[at].startswith(" ") or QUIET.match(lines[at])):
            hints = [line.strip() for line in lines[at + 1 : at + 2] if line.startswith("  (")]
            return " ".join([lines[at].removeprefix("captain: "), *hints])[:MOST]
    return ""


def _message(line: str) -> str:
    try:
        found = json.loads(line)["MESSAGE"]
    except (ValueError, KeyError, TypeError, RecursionError):
        return ""
    return found if isinstance(found, str) else ""


def _said(command: Sequence[str]) -> str:
    try:
        ended = subprocess.run(command, capture_output=True, env=environment(), timeout=LIMIT_S, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return ended.stdout.decode("utf-8", "replace")
