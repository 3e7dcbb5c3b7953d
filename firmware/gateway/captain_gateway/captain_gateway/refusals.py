"""Errors of rclpy for invalid names and parameters, converted to one line."""

import contextlib
from collections.abc import Iterator

from rclpy.exceptions import NameValidationException, ParameterException
from rclpy.qos_overriding_options import InvalidQosOverridesError

from .errors import GatewayError

# RuntimeError covers RCLError and related errors, which no public module of rclpy exports.
REFUSALS = (RuntimeError, ValueError, NameValidationException, ParameterException, InvalidQosOverridesError)


@contextlib.contextmanager
def in_words(about: str) -> Iterator[None]:
    """Raise GatewayError with `about` and the reason, on one line, for each refusal of rclpy."""
    try:
        yield
    except REFUSALS as error:
        raise GatewayError(f"{about}: {' '.join(str(error).split())}") from error
