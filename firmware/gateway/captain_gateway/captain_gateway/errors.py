"""Errors of users and peers; str() names place, value and remedy."""


class GatewayError(Exception):
    """Error of the user: an invalid parameter, or a package that is not installed."""


class RefusedError(Exception):
    """A message that is not passed on.

    cause  name of the counter that counts it.
    """

    def __init__(self, cause: str, why: str) -> None:
        super().__init__(why)
        self.cause = cause
