"""Text that a user reads: its place, value and key words, in place of its sentence."""

from collections.abc import Mapping


def tells(text: str, *parts: str) -> bool:
    """Return True if a text has these parts, in this order and without overlap."""
    at = 0
    for part in parts:
        found = text.find(part, at)
        if found < 0:
            return False
        at = found + len(part)
    return True


def of_key(found: Mapping[str, str], word: str) -> str:
    """Return the text of the only key that contains a word. Raises ValueError if none or several do."""
    (text,) = (text for key, text in found.items() if word in key)
    return text
