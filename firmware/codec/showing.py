"""Text of a decoded message for a screen."""

import textwrap

from firmware.codec.identify import Identity
from firmware.codec.reading import Pdu
from firmware.printable import clean


def tree(pdu: Pdu, found: Identity, width: int) -> str:
    """Return a decoded message as text for a screen.

    It has a heading, reasons for and doubts about the edition, the fields, and an empty line. width: of the reasons, in
    columns.
    """
    head = f"{found.message.name}: {found.message.standard}, {len(pdu.octets)} octets, {pdu.origin}"
    if pdu.carried:
        head += f" ({pdu.carried})"
    why = textwrap.wrap(clean(found.why), width, initial_indent="  ", subsequent_indent="  ")
    if found.doubt:
        why += textwrap.wrap(f"warning: {clean(found.doubt)}", width, initial_indent="  ", subsequent_indent="  ")
    fields = [clean(line) for line in found.message.text(pdu.octets).splitlines()]
    return "\n".join([clean(head), *why, *fields, ""])
