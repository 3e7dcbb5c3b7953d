"""What rclpy does not take of a user's names and parameters, in a line."""

import contextlib
from collections.abc import Iterator

from rclpy.exceptions import NameValidationException, ParameterException
from rclpy.qos_overriding_options import InvalidQosOverridesError

from .errors import GatewayError

# RuntimeError: RCLError and its kin, which no module of rclpy names for users.
REFUSALS = (RuntimeError, ValueError, NameValidationException, ParameterException, InvalidQosOverridesError)


@contextlib.contextmanager
def in_words(about: str) -> Iterator[None]:
    """Raises GatewayError, with what it is about, for whatever is refused inside."""
    try:
        yield
    except REFUSALS as error:
        raise GatewayError(f"{about}: {' '.join(str(error).split())}") from error
