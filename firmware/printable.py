"""Text of failures: for terminals, without control characters; for programs."""

from typing import TextIO

from board.runtime.errors import ConfigurationError, StationError

MOST_MISTAKES = 50  # limit of printed mistakes: a file of a wrong kind has thousands


def clean(text: str) -> str:
    """Return a text with unprintable characters escaped, because a terminal would execute control characters."""
    return "".join(letter if letter.isprintable() else f"\\x{ord(letter):02x}" for letter in text)


def folded(text: str, stream: TextIO) -> str:
    """Return a text for a stream: a terminal gets lines folded between words, with a hanging indent of two columns."""
    if not stream.isatty():
        return text
    import shutil
    import textwrap

    columns = shutil.get_terminal_size((80, 24)).columns
    lines = []
    for line in text.split("\n"):
        indent = " " * (len(line) - len(line.lstrip()) + 2)
        parts = textwrap.wrap(line, columns, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)
        lines += parts if len(line) > columns else [line]
    return "\n".join(lines)


def failure(error: StationError) -> str:
    """Return the text of an error with its hint. Each mistake in a configuration file has its own line."""
    message = "\n".join(mistakes(error)) if isinstance(error, ConfigurationError) else clean(error.message)
    return f"{message}\n  ({clean(error.hint)})" if error.hint else message


def failure_record(error: StationError) -> dict[str, object]:
    """Return an error for --json: the members `error` and `hint`, both strings."""
    return {"error": error.message, "hint": error.hint}


def mistakes(error: StationError) -> list[str]:
    """Return the mistakes in a file as lines: at most MOST_MISTAKES, then the number of the others."""
    lines = error.message.split("\n")
    more = len(lines) - MOST_MISTAKES
    told = [clean(line) for line in lines[:MOST_MISTAKES]]
    return (
        [*told, f"{more} more {'mistake' if more == 1 else 'mistakes'}; check that this is the right file"]
        if more > 0
        else told
    )
