"""Failures that are nobody's bug; str() says what, where, the value, and the remedy."""


class GatewayError(Exception):
    """What a user can put right: a parameter, a package that is not there."""


class RefusedError(Exception):
    """A message that is not passed on.

    cause  the counter that it goes to.
    """

    def __init__(self, cause: str, why: str) -> None:
        super().__init__(why)
        self.cause = cause
