"""SIGTERM as an end like any other: what was done is told."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager


class _Asked(BaseException):
    """Nothing on the way takes it for an error."""


@contextmanager
def until_sigterm() -> Iterator[None]:
    """What is done inside ends by SIGTERM, and what follows goes on; there it is what it was."""

    def end(_number: int, _frame: object) -> None:
        raise _Asked

    before = signal.signal(signal.SIGTERM, end)
    try:
        yield
    except _Asked:
        pass
    finally:
        signal.signal(signal.SIGTERM, before)
