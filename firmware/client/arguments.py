"""Arguments that several commands share, and parsers of their values."""

import argparse
import math
from collections.abc import Callable
from typing import TYPE_CHECKING

from board.runtime import address as addresses
from board.runtime.address import check_socket_path
from board.runtime.describe import remedy
from board.runtime.errors import ConfigurationError
from firmware import topics

if TYPE_CHECKING:  # imported for type checks only: `captain run` loads this module and needs neither of the two
    from firmware.client.client import Address
    from firmware.systemd import Unit

MOST_MESSAGES = 10**9
LONGEST_S = 1e9  # thirty years: in effect unlimited
HIGHEST_RATE = 1e6  # messages per second: ten times the capacity of a station

Integer = Callable[[str], int]
Number = Callable[[str], float]

# -- options that several commands share


def add_station(parser: argparse.ArgumentParser) -> None:
    """Add the options that name a station for users' commands: host and ports. address() reads them."""
    group = parser.add_argument_group("the station")
    group.add_argument(
        "--station",
        metavar="HOST[:PORT]",
        type=station,
        default=("127.0.0.1", 5555),
        help="host of the station and its port for users' PUB sockets (default 127.0.0.1:5555); the other ports "
        "follow: +1 to users, +2 PULL, +3 reports",
    )
    group.add_argument(
        "--to-users", metavar="PORT", type=port, help="port for users' SUB sockets (default: --station's + 1)"
    )
    group.add_argument(
        "--pull", metavar="PORT", type=port, help="port for users' PUSH sockets (default: --station's + 2)"
    )
    group.add_argument(
        "--report", metavar="PORT", type=port, help="port for status and confirms (default: --station's + 3)"
    )


def address(options: argparse.Namespace) -> "Address":
    """Return the address that the options of add_station() give."""
    from firmware.client.client import Address

    host, first = options.station
    return Address(host, first, options.to_users or first + 1, options.pull or first + 2, options.report or first + 3)


def add_control(parser: argparse.ArgumentParser) -> None:
    """Add the options that name a station of this machine: control socket, host and ports."""
    add_socket(parser)
    add_station(parser)


def add_socket(parser: argparse.ArgumentParser) -> None:
    """Add the option --control with the path of a control socket."""
    what = "control socket of a station of this machine"
    parser.add_argument("--control", metavar="PATH", type=socket_path, default="", help=what)


def add_configuration(parser: argparse.ArgumentParser) -> None:
    """Add the options that name a station's configuration; captain_toml.load() takes their values."""
    parser.add_argument(
        "--config", metavar="FILE", help="captain.toml of the station (default: all options have their defaults)"
    )
    parser.add_argument("--defaults", metavar="FILE", help="second captain.toml, for keys that --config does not have")
    parser.add_argument(
        "--board",
        help="board file, with hardware and simulated neighbours: sim, quad, pi, none, or a path "
        "(default: sim; none with --config)",
    )
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="SECTION.KEY=VALUE",
        dest="overrides",
        help="override one option of captain.toml or of an interface of the board; may be repeated",
    )


def as_service(options: argparse.Namespace) -> "Unit | None":
    """Fill in the options of the installed station service, and return its systemd unit.

    Returns None, and changes nothing, if the command line already has an option of add_configuration(), or no service
    is installed.
    """
    if options.overrides or any(value is not None for value in (options.config, options.defaults, options.board)):
        return None
    from firmware import systemd

    unit = systemd.ask()
    if unit is not None:
        parser = argparse.ArgumentParser(add_help=False)
        add_configuration(parser)
        parser.parse_known_args(systemd.options(unit), options)
    return unit


# -- parsers of values; each raises ArgumentTypeError for an invalid text


def station(text: str) -> tuple[str, int]:
    """Parse a station's host and first port from `HOST`, `HOST:PORT`, `:PORT` or `[V6]:PORT`.

    Returns 127.0.0.1 for a missing host and 5555 for a missing port. Raises ArgumentTypeError for an invalid text, and
    for a port above 65532: a station has three more ports after its first one.
    """
    from captain_client.address import parse

    try:
        place = parse(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from error
    return place.host, place.from_users


def udp_address(text: str) -> addresses.Address:
    """Parse an IPv4 address with port. Raises ArgumentTypeError for any other text."""
    try:
        return addresses.address(text)
    except ConfigurationError as error:
        raise argparse.ArgumentTypeError(error.message) from error


def socket_path(text: str) -> str:
    """Return the path if it is valid for a Unix socket. Raises ArgumentTypeError if it is too long."""
    try:
        check_socket_path(text)
    except ConfigurationError as error:
        raise argparse.ArgumentTypeError(f"{error.message}; {error.hint}") from error
    return text


def integer(least: int, most: int) -> Integer:
    """Return a parser of decimal integers from least to most, both included."""

    def read(text: str) -> int:
        if not (text.isascii() and text.isdigit() and least <= int(text) <= most):
            raise argparse.ArgumentTypeError(f"{text!r}: out of range; {least} to {most}")
        return int(text)

    return read


def number(unit: str, most: float, is_zero_allowed: bool = False) -> Number:
    """Return a parser of finite numbers up to `most`.

    unit             unit of the number, for error messages.
    is_zero_allowed  accept 0; otherwise the number must be above 0.
    """
    limits = f"{'0 to' if is_zero_allowed else 'above 0, at most'} {most:,.0f} {unit}"

    def read(text: str) -> float:
        value = finite(text)
        if value is None or not 0.0 <= value <= most or (value == 0.0 and not is_zero_allowed):
            raise argparse.ArgumentTypeError(f"{text!r}: out of range; {limits}")
        return value

    return read


def message_type(text: str) -> str | int:
    """Return a message type, given by its name in the envelope or by its messageID.

    The empty name selects messages without a type name (`v2x..`). Types that a station's captain.toml defines in
    [[types]] are unknown here. Raises ArgumentTypeError for an unknown name, and for a messageID above 255.
    """
    if text.isascii() and text.isdigit():
        digits = text.lstrip("0") or "0"
        if len(digits) > 3 or int(digits) > 255:
            raise argparse.ArgumentTypeError(f"{text[:20]!r}: messageID out of range; 0 to 255")
        return int(digits)
    names = dict.fromkeys(row.name for row in topics.ROWS)
    if text and text.lower() not in names:
        raise argparse.ArgumentTypeError(
            f"{text!r}: unknown type; {remedy(text.lower(), names)} (for a type of [[types]] give its messageID)"
        )
    return text.lower()


def finite(text: str) -> float | None:
    """Return the text as a finite number; None if it is invalid, NaN or infinite."""
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) else None


port = integer(1, 0xFFFF)
times = integer(1, MOST_MESSAGES)
seconds = number("seconds", LONGEST_S)
