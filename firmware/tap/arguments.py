"""A broker on the command line, in the words of the mqtt interface's options."""

import argparse
import os
import socket

from board.errors import ConfigurationError, UsageError
from drivers.mqtt_options import KEEP_ALIVE_S, SESSION_EXPIRY_S, MqttOptions, check_files
from drivers.mqtt_profile import names
from firmware.user.arguments import integer


def add_broker(parser: argparse.ArgumentParser) -> None:
    """The options that settings_of() reads."""
    group = parser.add_argument_group("the broker, as in [interfaces.NAME] with driver = mqtt")
    group.add_argument("--url", required=True, help="mqtts://HOST[:PORT], or mqtt://HOST[:PORT] without TLS")
    group.add_argument(
        "--profile", default="vcaptain", help=f"{', '.join(names())}, or a TOML file with another (default vcaptain)"
    )
    group.add_argument("--prefix", default="", help="that topics begin with, where the profile lets them")
    group.add_argument("--ca", metavar="FILE", default="", help="who signs brokers (default: those of the system)")
    group.add_argument("--certificate", metavar="FILE", default="", help="of this client, where the broker asks")
    group.add_argument("--key", metavar="FILE", default="", help="its key, which nobody else may read")
    group.add_argument("--username", metavar="NAME", default="")
    group.add_argument("--password-file", metavar="FILE", default="", help="first line: the password")
    group.add_argument("--version", choices=("5", "3.1.1"), default="5", help="of MQTT (default 5)")
    group.add_argument("--client-id", metavar="NAME", default="", help="unique per broker (default: one of its own)")
    group.add_argument(
        "--keep-alive-s", metavar="S", type=integer(5, 3600), default=KEEP_ALIVE_S, help="(default %(default)s)"
    )
    group.add_argument(
        "--session-expiry-s",
        metavar="S",
        type=integer(1, 2_592_000),
        help="the broker keeps for so long, at QoS 1, the share of a copy that was killed or is cut off; one that ends "
        "leaves nothing behind; needs --client-id",
    )
    group.add_argument("--qos", type=integer(0, 2), help="in place of the profile's")
    group.add_argument("--plaintext", action="store_true", help="without TLS even to another machine")


def settings_of(arguments: argparse.Namespace) -> MqttOptions:
    """What add_broker() was given. Raises StationError for what does not go together or is not there."""
    expiry_s = arguments.session_expiry_s
    if expiry_s is not None and not arguments.client_id:
        raise UsageError("--session-expiry-s without --client-id", "a session is found again by its client's name")
    given = {
        name: getattr(arguments, name)
        for name in ("url", "profile", "prefix", "ca", "certificate", "key", "username", "password_file", "qos")
    } | {
        "client_id": arguments.client_id or _own_name(),
        "version": 5 if arguments.version == "5" else arguments.version,
        "keep_alive_s": arguments.keep_alive_s,
        "clean": expiry_s is None,
        "session_expiry_s": expiry_s or SESSION_EXPIRY_S,
        "plaintext": arguments.plaintext,
    }
    try:
        options = MqttOptions(**given)
    except ConfigurationError as error:
        raise UsageError(error.message, error.hint) from error
    check_files(options)
    return options


def _own_name() -> str:
    """One that no other copy has."""
    return f"captain-tap-{socket.gethostname()[:40]}-{os.getpid()}-{os.urandom(3).hex()}"
