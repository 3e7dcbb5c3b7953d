"""Text for people: whatever it names makes no line of its own, and nothing in it is obeyed by a terminal."""

from board.errors import ConfigurationError, StationError

MOST_MISTAKES = 50  # a file of another kind has thousands


def clean(text: str) -> str:
    """Text of a peer without anything that a terminal would obey."""
    return "".join(letter if letter.isprintable() else f"\\x{ord(letter):02x}" for letter in text)


def failure(error: StationError) -> str:
    """An error with its hint. The mistakes of a file have a line each; nothing else makes lines."""
    message = "\n".join(mistakes(error)) if isinstance(error, ConfigurationError) else clean(error.message)
    return f"{message}\n  ({clean(error.hint)})" if error.hint else message


def mistakes(error: StationError) -> list[str]:
    """The mistakes of a file, MOST_MISTAKES at most, then the count of the rest."""
    lines = error.message.split("\n")
    more = len(lines) - MOST_MISTAKES
    told = [clean(line) for line in lines[:MOST_MISTAKES]]
    return (
        [*told, f"{more} more {'mistake' if more == 1 else 'mistakes'}; check that this is the right file"]
        if more > 0
        else told
    )
