"""Options for a broker, with the names of the mqtt interface's options."""

import argparse
import os
import socket

from board.runtime.errors import ConfigurationError, UsageError
from drivers.mqtt.options import KEEP_ALIVE_S, SESSION_EXPIRY_S, MqttOptions, check_files
from drivers.mqtt.profile import names
from firmware.client.arguments import integer


def add_broker(parser: argparse.ArgumentParser) -> None:
    """Add the options for a broker; settings_of() reads their values."""
    group = parser.add_argument_group("the broker, as in [interfaces.NAME] with driver = mqtt")
    group.add_argument("--url", required=True, help="mqtts://HOST[:PORT], or mqtt://HOST[:PORT] without TLS")
    group.add_argument(
        "--profile", default="vcaptain", help=f"{', '.join(names())}, or a TOML file with a profile (default vcaptain)"
    )
    group.add_argument("--prefix", default="", help="first levels of all topics, if the profile has a prefix")
    group.add_argument(
        "--ca", metavar="FILE", default="", help="certificates of authorities (default: those of the system)"
    )
    group.add_argument(
        "--certificate", metavar="FILE", default="", help="certificate of this client, if the broker asks"
    )
    group.add_argument("--key", metavar="FILE", default="", help="key of this client; only you may have access")
    group.add_argument("--username", metavar="NAME", default="", help="user name at the broker")
    group.add_argument("--password-file", metavar="FILE", default="", help="file whose first line is the password")
    group.add_argument("--version", choices=("5", "3.1.1"), default="5", help="version of MQTT (default 5)")
    group.add_argument("--client-id", metavar="NAME", default="", help="unique at the broker (default: a new one)")
    group.add_argument(
        "--keep-alive-s",
        metavar="S",
        type=integer(5, 3600),
        default=KEEP_ALIVE_S,
        help="interval of keep-alive messages (default %(default)s)",
    )
    group.add_argument(
        "--session-expiry-s",
        metavar="S",
        type=integer(1, 2_592_000),
        help="time for which the broker keeps messages (QoS 1) of a copy that was killed or disconnected; a copy that "
        "ends leaves none; needs --client-id",
    )
    group.add_argument("--qos", type=integer(0, 1), help="quality of service, in place of the profile's")
    group.add_argument("--plaintext", action="store_true", help="permit mqtt:// to another machine, without TLS")


def settings_of(arguments: argparse.Namespace) -> MqttOptions:
    """Return the settings that the options of add_broker() give.

    Raises UsageError for an invalid combination, and StationError for a missing file.
    """
    expiry_s = arguments.session_expiry_s
    if expiry_s is not None and not arguments.client_id:
        raise UsageError(
            "--session-expiry-s: only with --client-id", "add --client-id NAME: the broker finds a session by it"
        )
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
    """Return a client name that is unique for each copy of the tap."""
    return f"captain-tap-{socket.gethostname()[:40]}-{os.getpid()}-{os.urandom(3).hex()}"
