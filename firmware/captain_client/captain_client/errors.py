"""Errors of the client, each with a remedy."""

from collections.abc import Mapping, Sequence
from typing import Any


class StationError(Exception):
    """Expected failure at a station, or with one of its messages.

    message  what failed, where, and the value.
    hint     remedy; empty if the message contains it already.
    """

    def __init__(self, message: str, hint: str = "") -> None:
        super().__init__(message, hint)
        self.message = message
        self.hint = hint

    def __str__(self) -> str:
        return f"{self.message}\n  ({self.hint})" if self.hint else self.message


class UnreachableError(StationError):
    """No station answers at the address within the timeout."""


class RefusedError(StationError):
    """The station refused a request, or no interface sent it.

    reason   drop reason, such as `bad-json`; firmware/reference/drops.md lists them.
    detail   cause of this drop; may be empty.
    invalid  all faults of a message in JSON, each with `path`, `problem` and `value`; empty for other requests.
    """

    def __init__(
        self,
        message: str,
        hint: str = "",
        reason: str = "",
        detail: str = "",
        invalid: Sequence[Mapping[str, Any]] = (),
    ) -> None:
        super().__init__(message, hint)
        self.reason = reason
        self.detail = detail
        self.invalid = tuple(invalid)


class UnconfirmedError(StationError):
    """The outcome of a request is unknown: its confirms did not come, or the station was restarted meanwhile."""
