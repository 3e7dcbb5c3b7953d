"""Device names by slot: udev rules, generated from the board file.

/dev/slot/cellular-02 is interface 2 of the module in slot `cellular`, independent of the kernel's number for its port.
The station itself finds modules by USB port. The names are for people, other programs, and board files with a `port`.
"""

from collections.abc import Mapping
from typing import Any

PATH = "usr/lib/udev/rules.d/71-captain-slots.rules"

_HEAD = """\
# Generated from the board file {board}: names of the slots' ports, by their place on USB.
"""
# KERNELS and ATTRS match the same parent: the interface of a USB device, 1-1.3:1.2. $attr is its two-digit number.
_RULE = """\
SUBSYSTEM=="tty|usbmisc", SUBSYSTEMS=="usb", KERNELS=="{place}:*", ATTRS{{bInterfaceNumber}}=="?*", \
ENV{{CAPTAIN_SLOT}}="{name}", SYMLINK+="slot/{name}-$attr{{bInterfaceNumber}}"
"""


def rules(board: Mapping[str, Any]) -> str:
    """Return the rules file. board: tables of a board file; a slot without a USB port gets no name."""
    slots = board.get("slots", {})
    places = {name: slot["usb"] for name, slot in slots.items() if slot.get("usb")}
    lines = [_RULE.format(name=name, place=place) for name, place in sorted(places.items())]
    return "".join([_HEAD.format(board=board.get("name", "")), *lines])
