"""What can go wrong and is expected to: every error that a user or a peer can cause is a StationError.

Anything else that is raised is a bug of ours and ends the process with a traceback.
"""


class StationError(Exception):
    """An expected failure: what, where and the value, and what to do about it.

    message  names what failed, where, and the value that was met.
    hint     says what to do; empty where the message says it already.
    """

    def __init__(self, message: str, hint: str = "") -> None:
        super().__init__(message)
        self.message = message
        self.hint = hint

    def __str__(self) -> str:
        return f"{self.message}\n  ({self.hint})" if self.hint else self.message


class ConfigurationError(StationError):
    """A configuration or board file says something that cannot be meant: unknown key, wrong type, range."""


class RequestError(StationError):
    """A user asked for something that cannot be done; the answer goes back to that user."""


class ProtocolError(StationError):
    """A peer sent octets that its protocol does not allow."""


class InterfaceError(StationError):
    """A device, socket or line is absent, busy, gone or refuses; the supervisor tries again later."""


class BlockedError(InterfaceError):
    """Something of this machine stands in the way: a library that is absent, a port that another program has.

    No module is to blame and losing its power would not help: it is tried again, for ever.
    """


class StuckError(InterfaceError):
    """A module obeys no command any more, so that only losing its power may help.

    The supervisor cuts the power of its slot at once; where it has no slot, it is tried again as after every failure.
    """


class StorageError(StationError):
    """State that was to outlive a restart cannot be kept or read: its folder is absent, full, or takes no writes."""


class UsageError(StationError):
    """A command line asks for what does not go together: exit status 2."""
