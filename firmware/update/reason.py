"""Reasons for refused updates: D-Bus and RAUC errors in words, with remedies."""

import re

from firmware.update.trouble import Trouble

LOG = "see journalctl -u rauc"
AGAIN = f"run captain update again, which writes the whole slot; {LOG}"
WORN = "run captain update again, which writes the whole slot; if that fails too, the card is worn out"
MOST = 200  # most characters shown of an unknown message

# Patterns of messages, their meaning, and a remedy. The first match counts; without a meaning, RAUC's words are shown.
# Sources: D-Bus Specification, "Standard error names"; busctl of systemd 257; RAUC 1.10, whose service ended during a
# write: github.com/rauc/rauc, 1452.
REASONS = (
    (r"StartServiceByName|ServiceUnknown|NameHasNoOwner|activate remote peer|activation request|Spawn\.",
     "the update service does not start", LOG),
    (r"DBus\.Error\.Time(d)?[Oo]ut|Did not receive a reply|[Tt]imeout was reached|(Connection|call) timed out",
     "timeout of the update service", LOG),
    (r"service disappeared|NoReply|Disconnected|disconnected from message bus|Remote peer disconnected",
     "the update service ended", AGAIN),
    (r"Could not connect|connect to bus|system bus",
     "D-Bus does not answer", "captain update --restart may help"),
    (r"pre-install handler", "this slot is on trial, or the boot counters cannot be written", LOG),
    (r"Input/output error|Read-only file system", "", WORN),
    (r"ompatible mismatch", "", "use the bundle of this box's image"),
)  # fmt: skip
_NAMES = re.compile(
    r"GDBus\.Error:[\w.]+:? ?|D-Bus error while installing `[^`]*`:? ?|\b(org|de)(\.\w+)*\.Error\.\w+:? ?"
)
_LAST = re.compile(r"LastError: (.*)")


def spoken(said: str) -> list[str]:
    """Return the lines of RAUC's output that are meant for users, without its log lines."""
    return [line.strip() for line in said.splitlines() if line.strip() and "rauc-Message" not in line]


def reason(said: str) -> Trouble:
    """Return meaning and remedy of an error from RAUC, D-Bus or the service's LastError."""
    lines = [line.strip() for line in _LAST.findall(said) or said.splitlines()]
    told = [words for line in spoken("\n".join(lines)) if (words := _NAMES.sub("", line).strip())]
    own = told[-1][:MOST] if told else "no reason given"
    for pattern, words, hint in REASONS:
        if re.search(pattern, "\n".join(lines)):
            return Trouble(words or own, hint)
    return Trouble(own, LOG)
