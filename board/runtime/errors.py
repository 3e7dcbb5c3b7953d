"""Expected errors: every error that a user or peer can cause.

Any other exception is a bug and ends the process with a traceback.
"""


class StationError(Exception):
    """Expected failure, with a remedy.

    message  what failed, where, and the value.
    hint     remedy; empty if the message contains it already.
    """

    def __init__(self, message: str, hint: str = "") -> None:
        super().__init__(message)
        self.message = message
        self.hint = hint

    def __str__(self) -> str:
        return f"{self.message}\n  ({self.hint})" if self.hint else self.message


class ConfigurationError(StationError):
    """Invalid configuration or board file: unknown key, wrong type, value out of range."""


class RequestError(StationError):
    """A user's request that cannot be executed; the error is the answer to that user."""


class ProtocolError(StationError):
    """Octets from a peer that violate its protocol."""


class InterfaceError(StationError):
    """A device, socket or line is absent, in use, gone, or refuses; the supervisor retries later."""


class BlockedError(InterfaceError):
    """A cause on this machine blocks an interface: a missing library, or a port that another program uses.

    The module is not the cause, and a power cycle would not help. The supervisor retries without limit.
    """


class StuckError(InterfaceError):
    """A module that no longer obeys commands; only a power cycle may help.

    The supervisor cuts the power of its slot at once. A module without a slot is retried as after any failure.
    """


class StorageError(StationError):
    """Persistent state cannot be written or read: its folder is absent, full or read-only."""


class UsageError(StationError):
    """Invalid combination on the command line; exit status 2."""
