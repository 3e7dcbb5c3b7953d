"""What systemd says of the station: what it runs it with, what became of it, and the station's own last words.

Its word counts, and no file beside it: what it says is what it does, drop-ins and the owner's environment included.
"""

import json
import os
import re
import shlex
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path

from board.tool import environment

UNIT = "captain.service"
MANAGER = Path("/run/systemd/system")  # sd_booted(3): is there where systemd runs
FOLDERS = tuple(map(Path, ("/etc/systemd/system", "/run/systemd/system", "/usr/lib/systemd/system")))
SHOW = (
    "systemctl",
    "show",
    UNIT,
    "--property=LoadState,ActiveState,SubState,Result,NRestarts,ExecMainStatus,ExecStart,Environment,EnvironmentFiles,"
    "WorkingDirectory",
)
# Of its own processes: what systemd says of them is in the unit's state.
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
LIMIT_S = 5.0  # each of the two takes 0.1 s
# The image's unit has its environment there, and that of no package has.
IMAGE = "/run/captain-image/"
ARGV = re.compile(r"argv\[\]=(.*?) ; ignore_errors=")
VARIABLE = re.compile(r"\$\{(\w+)\}")
# Lines that do not say why the station has ended.
QUIET = re.compile(r"[\w.]+: (?:DEBUG|INFO|WARNING): ")
MOST = 400  # letters of last words

ASK_IT = "the service runs it: `systemctl status captain` says how it does, `captain doctor` what to do"
CORRECT_CARD = (
    "correct captain.toml on the card's first partition, look at it by `captain box check` on that computer, and start "
    "the box with it"
)
RESTART_BOX = "`captain update --restart` restarts the box"

Unit = Mapping[str, str]  # properties of a unit that is loaded


def is_installed() -> bool:
    """Whether the station is a service of this machine."""
    return MANAGER.exists() and any((folder / UNIT).exists() for folder in FOLDERS)


def ask() -> Unit | None:
    """The unit; None where systemd does not run, or has none."""
    return read(_said(SHOW)) if MANAGER.exists() else None


def journal() -> str:
    """For last_words()."""
    return _said(SAID)


def read(shown: str) -> Unit | None:
    """What SHOW says; None where there is no such unit."""
    found: dict[str, str] = {}
    for line in shown.splitlines():
        key, _, value = line.partition("=")
        found[key] = f"{found[key]}\n{value}" if key in found else value  # EnvironmentFiles: a line for each
    return found if found.get("LoadState") == "loaded" else None


# -- what it is run with


def options(unit: Unit) -> list[str]:
    """What follows `captain run`: ${X} is part of a word, $X words. Source: systemd.service(5), "Command lines"."""
    found = ARGV.search(unit.get("ExecStart", ""))
    _, _, given = (found[1] if found else "").partition(" run ")
    known = _environment(unit)
    words: list[str] = []
    for word in given.split():
        words += known.get(word[1:], "").split() if re.fullmatch(r"\$\w+", word) else [_replaced(word, known)]
    return words


def folder(unit: Unit) -> str:
    """Where its paths begin."""
    wanted = unit.get("WorkingDirectory", "").lstrip("!-")  # it may be absent; then, and without one, it is the root
    return wanted if os.path.isdir(wanted) and os.access(wanted, os.X_OK) else "/"


def is_box(unit: Unit) -> bool:
    """Whether this is the image, whose user becomes root by no command."""
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
            continue  # one that is not there adds nothing; systemd tells what it cannot read
    pairs = (word.partition("=") for word in words)
    return {key: value for key, _, value in pairs}


# -- what became of it


def state(unit: Unit) -> str:
    """In words."""
    active, sub, result = unit.get("ActiveState", ""), unit.get("SubState", ""), unit.get("Result", "")
    parts = [f"{UNIT} is {active}" + (f" ({sub})" if sub not in ("", active) else "")]
    if result not in ("", "success"):
        status = unit.get("ExecMainStatus", "0")
        parts.append(f"its last run: {result}{f' {status}' if status != '0' else ''}")
    if restarts(unit):
        parts.append(f"started again {restarts(unit)} times")
    return ", ".join(parts)


def restarts(unit: Unit) -> int:
    """How often it was started again by itself."""
    count = unit.get("NRestarts", "")
    return int(count) if count.isdecimal() else 0


def is_active(unit: Unit) -> bool:
    return unit.get("ActiveState") in ("active", "reloading")


def remedy(unit: Unit) -> str:
    """What whoever may log in here can do about one that is not active, or does not stay so."""
    if unit.get("ActiveState") == "inactive":
        return RESTART_BOX if is_box(unit) else f"it is started by `systemctl start {UNIT}`"
    if unit.get("ActiveState") == "activating" and not restarts(unit):
        return "it is being started: look again in a minute"
    return CORRECT_CARD if is_box(unit) else f"correct {_configuration(unit)}, then `systemctl restart {UNIT}`"


def _configuration(unit: Unit) -> str:
    words = options(unit)
    return words[words.index("--config") + 1] if "--config" in words[:-1] else "what it says"


def last_words(said: str) -> str:
    """The newest sentence of the station that is no more than a note, with its hint; empty where there is none.

    said  what SAID gives: a line of JSON for each.
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
