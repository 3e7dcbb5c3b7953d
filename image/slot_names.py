"""Names of the modules' ports by the slot they are in: rules for udev, made of the board file when the image is built.

/dev/slot/cellular-02 is interface 2 of what is plugged in at the place of slot `cellular`, whatever number the kernel
gave its port this time. The station itself asks the kernel by the place; names are for people, for other programs, and
for board files with a module that is found by `port`.
"""

from collections.abc import Mapping
from typing import Any

PATH = "usr/lib/udev/rules.d/71-captain-slots.rules"

_HEAD = """\
# Made of the board file {board} when the image was built: what sits in which slot, by the place on USB.
"""
# KERNELS and ATTRS are those of one parent: the interface of a USB device, 1-1.3:1.2. $attr is its number, two digits.
_RULE = """\
SUBSYSTEM=="tty|usbmisc", SUBSYSTEMS=="usb", KERNELS=="{place}:*", ATTRS{{bInterfaceNumber}}=="?*", \
ENV{{CAPTAIN_SLOT}}="{name}", SYMLINK+="slot/{name}-$attr{{bInterfaceNumber}}"
"""


def rules(board: Mapping[str, Any]) -> str:
    """The file's text. board: tables of a board file; a slot without a known place gets no name."""
    slots = board.get("slots", {})
    places = {name: slot["usb"] for name, slot in slots.items() if slot.get("usb")}
    lines = [_RULE.format(name=name, place=place) for name, place in sorted(places.items())]
    return "".join([_HEAD.format(board=board.get("name", "")), *lines])
