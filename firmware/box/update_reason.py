"""Why the service of updates has not done it: D-Bus' names for that in plain words, RAUC's own with what to do."""

import re

from firmware.box.update_trouble import Trouble

LOG = "journalctl -u rauc tells more"
AGAIN = f"captain update writes it anew; {LOG}"
WORN = "captain update writes it anew; if that fails too, the card is worn out"
MOST = 200  # characters of what nobody has foreseen

# Without words RAUC's own are told; the first found counts. Sources: D-Bus Specification, "Standard error names";
# busctl of systemd 257; RAUC 1.10, whose service ended while it wrote: github.com/rauc/rauc, 1452.
_REASONS = (
    (r"StartServiceByName|ServiceUnknown|NameHasNoOwner|activate remote peer|activation request|Spawn\.",
     "the service of updates does not start", LOG),
    (r"DBus\.Error\.Time(d)?[Oo]ut|Did not receive a reply|[Tt]imeout was reached|(Connection|call) timed out",
     "the service of updates does not answer in time", LOG),
    (r"service disappeared|NoReply|Disconnected|disconnected from message bus|Remote peer disconnected",
     "the service of updates has ended meanwhile", AGAIN),
    (r"Could not connect|connect to bus|system bus",
     "D-Bus, by which the service of updates is asked, does not answer", "captain update --restart may mend it"),
    (r"pre-install handler", "this slot has not been well yet, or the boot counters cannot be written", LOG),
    (r"Input/output error|Read-only file system", "", WORN),
    (r"ompatible mismatch", "", "take the bundle of this box's image"),
)  # fmt: skip
_NAMES = re.compile(
    r"GDBus\.Error:[\w.]+:? ?|D-Bus error while installing `[^`]*`:? ?|\b(org|de)(\.\w+)*\.Error\.\w+:? ?"
)
_LAST = re.compile(r"LastError: (.*)")


def spoken(said: str) -> list[str]:
    """Lines of RAUC's output that are for people: those of its log are not."""
    return [line.strip() for line in said.splitlines() if line.strip() and "rauc-Message" not in line]


def reason(said: str) -> Trouble:
    """Of what a command of RAUC or D-Bus has said, or of the service's LastError."""
    lines = [line.strip() for line in _LAST.findall(said) or said.splitlines()]
    told = [words for line in spoken("\n".join(lines)) if (words := _NAMES.sub("", line).strip())]
    own = told[-1][:MOST] if told else "it gives no reason"
    for pattern, words, hint in _REASONS:
        if re.search(pattern, "\n".join(lines)):
            return Trouble(words or own, hint)
    return Trouble(own, LOG)
