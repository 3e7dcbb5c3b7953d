"""Arguments of the command line that several commands have, and how their values are read."""

import argparse
import math
from collections.abc import Callable

from board.address import check_socket_path, host_and_port
from board.describe import remedy
from board.errors import ConfigurationError
from firmware import topics
from firmware.user import systemd
from firmware.user.client import Address

MOST_MESSAGES = 10**9
LONGEST_S = 1e9  # thirty years: whoever asks for more means no end
HIGHEST_RATE = 1e6  # messages a second: ten times what a station can take

Integer = Callable[[str], int]
Number = Callable[[str], float]

# -- options


def add_station(parser: argparse.ArgumentParser) -> None:
    """The options by which every user's command names its station; address() reads them."""
    group = parser.add_argument_group("the station")
    group.add_argument(
        "--station",
        metavar="HOST[:PORT]",
        type=station,
        default=("127.0.0.1", 5555),
        help="its host and the port that users publish to (default 127.0.0.1:5555); the others follow: "
        "+1 to users, +2 PULL, +3 reports",
    )
    group.add_argument("--to-users", metavar="PORT", type=port, help="another port for users' SUB sockets")
    group.add_argument("--pull", metavar="PORT", type=port, help="another port for users' PUSH sockets")
    group.add_argument("--report", metavar="PORT", type=port, help="another port for status and confirms")


def address(options: argparse.Namespace) -> Address:
    """The address that the options of add_station() name."""
    host, first = options.station
    return Address(host, first, options.to_users or first + 1, options.pull or first + 2, options.report or first + 3)


def add_control(parser: argparse.ArgumentParser) -> None:
    """The options by which commands to a station of this machine name it."""
    add_socket(parser)
    add_station(parser)


def add_socket(parser: argparse.ArgumentParser) -> None:
    """The option that names a control socket."""
    what = "control socket of a station of this machine"
    parser.add_argument("--control", metavar="PATH", type=socket_path, default="", help=what)


def add_configuration(parser: argparse.ArgumentParser) -> None:
    """The options that say how a station is configured: as config.load() takes them."""
    parser.add_argument("--config", metavar="FILE", help="captain.toml: what is wanted (default: nothing but defaults)")
    parser.add_argument(
        "--defaults", metavar="FILE", help="another captain.toml, for the keys that --config does not have"
    )
    parser.add_argument(
        "--board",
        help="what is there: sim, quad, pi, none, or a board file of your own, which also has the simulated "
        "neighbours (default: sim, but none with --config)",
    )
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="SECTION.KEY=VALUE",
        dest="overrides",
        help="overrides one option of captain.toml or of an interface of the board; may be repeated",
    )


def as_service(options: argparse.Namespace) -> systemd.Unit | None:
    """The unit whose station is meant where no option of add_configuration() is given; its options become these."""
    if options.overrides or any(value is not None for value in (options.config, options.defaults, options.board)):
        return None
    unit = systemd.ask()
    if unit is not None:
        parser = argparse.ArgumentParser(add_help=False)
        add_configuration(parser)
        parser.parse_known_args(systemd.options(unit), options)
    return unit


# -- values; each raises ArgumentTypeError


def station(text: str) -> tuple[str, int]:
    """Host and port of `HOST`, `HOST:PORT`, `:PORT`, `[V6]:PORT`."""
    host, number = host_and_port(text)
    first = port(number) if number else 5555
    if first + 3 > 0xFFFF:
        raise argparse.ArgumentTypeError(f"{text!r}: the three ports after {first} do not exist")
    return host or "127.0.0.1", first


def socket_path(text: str) -> str:
    """A path that a Unix socket may have."""
    try:
        check_socket_path(text)
    except ConfigurationError as error:
        raise argparse.ArgumentTypeError(f"{error.message}; {error.hint}") from error
    return text


def integer(least: int, most: int) -> Integer:
    """A reader of decimal digits within limits, both included."""

    def read(text: str) -> int:
        if not (text.isascii() and text.isdigit() and least <= int(text) <= most):
            raise argparse.ArgumentTypeError(f"{text!r} is not in {least} ... {most}")
        return int(text)

    return read


def number(unit: str, most: float, is_zero_allowed: bool = False) -> Number:
    """A reader of a number above 0, or from 0 on; unit is what there are so many of."""
    limits = f"{'from 0 on' if is_zero_allowed else 'above 0'}, at most {most:g}"

    def read(text: str) -> float:
        value = finite(text)
        if value is None or not 0.0 <= value <= most or (value == 0.0 and not is_zero_allowed):
            raise argparse.ArgumentTypeError(f"{text!r} is no number of {unit} {limits}")
        return value

    return read


def message_type(text: str) -> str | int:
    """A type by its name in the envelope, or by its messageID: the rows of a station's own are not known here.

    The empty name is that of all types without one (`v2x..`).
    """
    if text.isascii() and text.isdigit():
        digits = text.lstrip("0") or "0"
        if len(digits) > 3 or int(digits) > 255:
            raise argparse.ArgumentTypeError(f"{text[:20]!r} is no messageID: those are 0 ... 255")
        return int(digits)
    names = dict.fromkeys(row.name for row in topics.ROWS)
    if text and text.lower() not in names:
        raise argparse.ArgumentTypeError(
            f"{text!r} is no type; {remedy(text.lower(), names)} (one that only the station knows: its messageID)"
        )
    return text.lower()


def finite(text: str) -> float | None:
    """A number that is neither infinite nor NaN; None for the rest."""
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) else None


port = integer(1, 0xFFFF)
times = integer(1, MOST_MESSAGES)
seconds = number("seconds", LONGEST_S)
