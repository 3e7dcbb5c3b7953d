"""Errors that a person can fix: a message and a remedy, without traceback."""

from board.runtime.errors import StationError


class ImageError(StationError):
    """The card or a program cannot be built, read, checked or written."""
