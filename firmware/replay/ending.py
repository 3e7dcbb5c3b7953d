"""SIGTERM as a normal end, so that the summary is printed."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager


class _Asked(BaseException):
    """End by SIGTERM. It is not an Exception, so that no error handling catches it."""


@contextmanager
def until_sigterm() -> Iterator[None]:
    """End the context at SIGTERM and continue after it; then restore the previous signal handler."""

    def end(_number: int, _frame: object) -> None:
        raise _Asked

    before = signal.signal(signal.SIGTERM, end)
    try:
        yield
    except _Asked:
        pass
    finally:
        signal.signal(signal.SIGTERM, before)
