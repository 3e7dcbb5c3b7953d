"""Own files of card and Debian packages: the overlay, in two forms."""

import re
from pathlib import Path

OVERLAY = Path(__file__).parent / "overlay"
# Marks at the beginning of a line that only one form has, before a blank; lines without a mark are in both.
CARD, PACKAGE = "@CARD@", "@PACKAGE@"


def formed(text: str, form: str) -> str:
    """Return a text without the other form's lines, and without marks. form: CARD or PACKAGE."""
    other = PACKAGE if form == CARD else CARD
    lines = (line for line in text.splitlines(keepends=True) if not line.startswith(other))
    return "".join(re.sub(f"^{form} ?", "", line) for line in lines)


def read(path: str, form: str) -> str:
    """Return a file of the overlay in a form. path: below OVERLAY. Raises OSError if the file is absent."""
    return formed((OVERLAY / path).read_text(), form)
