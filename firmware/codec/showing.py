"""A decoded message on a screen."""

import textwrap

from firmware.codec.identify import Identity
from firmware.codec.reading import Pdu
from firmware.printable import clean


def tree(pdu: Pdu, found: Identity, width: int) -> str:
    """Heading, reasons for and doubts of the edition, fields, an empty line."""
    head = f"{found.message.name}: {found.message.standard}, {len(pdu.octets)} octets, {pdu.origin}"
    if pdu.carried:
        head += f" ({pdu.carried})"
    why = textwrap.wrap(clean(found.why), width, initial_indent="  ", subsequent_indent="  ")
    if found.doubt:
        why += textwrap.wrap(f"warning: {clean(found.doubt)}", width, initial_indent="  ", subsequent_indent="  ")
    fields = [clean(line) for line in found.message.text(pdu.octets).splitlines()]
    return "\n".join([clean(head), *why, *fields, ""])
