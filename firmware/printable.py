"""Text for people: whatever it names makes no line of its own, and nothing in it is obeyed by a terminal."""

from board.errors import ConfigurationError, StationError


def clean(text: str) -> str:
    """Text of a peer without anything that a terminal would obey."""
    return "".join(letter if letter.isprintable() else f"\\x{ord(letter):02x}" for letter in text)


def failure(error: StationError) -> str:
    """An error with its hint. The mistakes of a file have a line each; nothing else makes lines."""
    lines = error.message.split("\n") if isinstance(error, ConfigurationError) else [error.message]
    message = "\n".join(clean(line) for line in lines)
    return f"{message}\n  ({clean(error.hint)})" if error.hint else message
