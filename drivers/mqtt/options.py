"""Options of an interface with driver = "mqtt", and the files that they name."""

import os
import stat
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Literal

from board.runtime.address import check_device_name
from board.runtime.describe import Range, all_of, at_key, remedy
from board.runtime.errors import BlockedError, ConfigurationError
from drivers.mqtt.broker import broker
from drivers.mqtt.profile import check_editions, is_file, library_file, names
from drivers.wire.quadkey import MAX_DEPTH
from drivers.wire.v2n.message import MAX_SOURCE

KEEP_ALIVE_S = 20  # shorter than 30 s, after which some mobile networks forget an idle TCP connection
SESSION_EXPIRY_S = 30  # lifetime of a session at the broker; short, because late messages are passed on as if new
IN_FLIGHT = 20  # most unacknowledged publications

OTHERS = 0o077  # permission bits of group and others, which a secret file must not have

# Reason why a character is forbidden in a name.
_WILDCARD = "MQTT does not allow wildcards in topics of published messages"
_BEFORE_PORT = "payloads have (port) behind it"
_WHY_NOT = {"+": _WILDCARD, "#": _WILDCARD, "/": "it is one level of a topic", "(": _BEFORE_PORT, ")": _BEFORE_PORT}

Depth = Annotated[int, Range(1, MAX_DEPTH)]


@dataclass(frozen=True)
class MqttOptions:
    """Messages by an MQTT broker.

    url               address of the broker: "mqtts://broker.example:8883". "mqtt://" is without TLS.
    profile           topics and payloads: vcaptain, raw, orange or nap; or the path of a TOML file with another.
    client_id         unique per broker; the broker ends the older of two connections with the same one. Empty: the
                      host's name.
    host              name of the sender in messages and status. Empty: the client_id.
    station           stationID in topics, if the profile's topics contain one. 0: made from the station's address.
    uuid              identity in messages, if the profile's messages contain one; use the form of the other clients.
                      Empty: made from address and client_id.
    prefix            first levels of topics, if the profile lets them be set.
    requests          `true`: messages from the broker are requests to send, as those of users, and not received
                      messages. They never return to this broker.
    ca                file of the certificates that sign brokers. Empty: those of the system.
    certificate       file with the certificate of this client; needs key.
    key               file with its private key, readable only by its owner.
    username          user name at the broker; needs password_file.
    password_file     file with the password, readable only by its owner.
    version           MQTT version.
    keep_alive_s      a broker that is silent for twice this time is lost.
    clean             `false`: the broker keeps messages while the station is away, for session_expiry_s (3.1.1: without
                      limit), and delivers them as if received then. With a profile that has tiles, the first connection
                      starts clean in any case.
    session_expiry_s  lifetime of the session at the broker.
    qos               quality of service of sent messages, in place of the profile's.
    plaintext         allow a connection to another machine without TLS.
    device            network device of the connection. Empty: that of the bearer, or any without one.
    bearer            interface with the modem. The station connects only while it is up, and at once when it comes up.
                      Empty: none.
    status_topic      topic of status messages, in place of the profile's; older boxes have "v2xstatus".
    depths            least and most quadkey levels, in place of the profile's: [14, 18].
    editions          editions to encode JSON payloads in, in place of the preferred ones: ["cpm-2.1.1-ext"].
    max_in_flight     most messages that the broker has not acknowledged; others wait in the queue.
    """

    url: str
    profile: str = "vcaptain"
    client_id: str = ""
    host: str = ""
    station: Annotated[int, Range(0, 4_294_967_295)] = 0
    uuid: str = ""
    prefix: str = ""
    requests: bool = False
    ca: str = ""
    certificate: str = ""
    key: str = ""
    username: str = ""
    password_file: str = ""
    version: Literal[5, "3.1.1"] = 5
    keep_alive_s: Annotated[int, Range(5, 3600)] = KEEP_ALIVE_S
    clean: bool = True
    session_expiry_s: Annotated[int, Range(1, 2_592_000)] = SESSION_EXPIRY_S
    qos: Annotated[int, Range(0, 1)] | None = None
    plaintext: bool = False
    device: str = ""
    bearer: str = ""
    status_topic: str = ""
    depths: tuple[Depth, ...] = ()
    editions: tuple[str, ...] = ()
    max_in_flight: Annotated[int, Range(1, 1000)] = IN_FLIGHT

    def __post_init__(self) -> None:
        """Check the options. Raises ConfigurationError with a line for each mistake."""
        names = ("client_id", "host", "uuid", "prefix", "status_topic")
        pairs = (("certificate", "key"), ("username", "password_file"))
        checks: list[Callable[[], None]] = [self._check_broker, self._check_profile]
        checks += [partial(self._check_name, name) for name in names]
        checks += [partial(self._check_pair, *pair) for pair in pairs]
        if self.device:
            checks.append(partial(at_key, "device", check_device_name, self.device))
        all_of([*checks, self._check_depths, partial(check_editions, self.profile, self.editions)])

    def _check_broker(self) -> None:
        there = broker(self.url)
        if there.has_tls:
            return
        if not (there.is_loopback or self.plaintext):
            hint = "write mqtts://, or plaintext = true if anyone on the network may read and change the messages"
            raise ConfigurationError(f'url: "{self.url}" without TLS to another machine', hint)
        for name in ("ca", "certificate", "key"):
            if getattr(self, name):
                raise ConfigurationError(f'{name}: without TLS in url: "{self.url}"', "write mqtts://, or leave it out")

    def _check_profile(self) -> None:
        if not is_file(self.profile) and self.profile not in names():
            hint = f"{remedy(self.profile, names())}; the path of a profile of your own ends in .toml"
            raise ConfigurationError(f'profile: unknown profile "{self.profile}"', hint)

    def _check_name(self, name: str) -> None:
        word, is_topic = getattr(self, name), name in ("prefix", "status_topic")
        _check_word(name, word, "+# " if is_topic else "/+#() ")
        if is_topic and word.startswith("$"):
            raise ConfigurationError(f"{name}: {word!r} starts with $", "such topics are the broker's own")

    def _check_pair(self, one: str, other: str) -> None:
        if bool(getattr(self, one)) != bool(getattr(self, other)):
            given, missing = (one, other) if getattr(self, one) else (other, one)
            raise ConfigurationError(f"{given} is given without {missing}", "give both or none")

    def _check_depths(self) -> None:
        if self.depths and (len(self.depths) != 2 or self.depths[0] > self.depths[1]):
            raise ConfigurationError(f"depths: {list(self.depths)} is not a minimum and a maximum", "write [14, 18]")

    def files(self) -> Iterator[tuple[str, str, bool]]:
        """Yield each file that the options name: option, path, and True if only its owner may read it."""
        if is_file(self.profile):
            yield "profile", self.profile, False
        for name, is_secret in (("ca", False), ("certificate", False), ("key", True), ("password_file", True)):
            if path := getattr(self, name):
                yield name, path, is_secret


def _check_word(name: str, word: str, forbidden: str) -> None:
    if (size := len(word.encode("utf-8", "replace"))) > MAX_SOURCE:
        raise ConfigurationError(f"{name}: has {size} octets", f"give {MAX_SOURCE} at most")
    if strange := [letter for letter in word if letter in forbidden or not letter.isprintable()]:
        hint = _WHY_NOT.get(strange[0], "leave it out")
        raise ConfigurationError(f"{name}: {word!r} has {strange[0]!r}", hint)


def check_files(options: MqttOptions) -> None:
    """Check the files of the options. Raises BlockedError if one is absent, unreadable, or a secret others may read."""
    for name, path, is_secret in options.files():
        check_file(name, path, is_secret)


def check_file(name: str, path: str, is_secret: bool) -> None:
    """Check one of MqttOptions.files() without opening it: the open of a FIFO would block.

    Raises BlockedError if it is absent, not a regular file, not readable, or a secret that others may read.
    """
    try:
        mode = os.stat(path).st_mode
    except OSError as error:
        hint = f"correct option {name}, or put the file at this path"
        raise BlockedError(f"{name} {path}: {error.strerror}", hint) from error
    if not stat.S_ISREG(mode):
        raise BlockedError(f"{name} {path}: not a regular file", f"correct option {name}")
    if not os.access(path, os.R_OK, effective_ids=True):
        hint = f"give it to the user that the station runs as: chown {_own_name()} {path}"
        raise BlockedError(f"{name} {path}: this user may not read it", hint)
    if is_secret and mode & OTHERS:
        raise BlockedError(f"{name} {path}: others may read it (mode {stat.S_IMODE(mode):04o})", f"chmod 600 {path}")


def _own_name() -> str:
    import pwd

    try:
        return pwd.getpwuid(os.geteuid()).pw_name
    except KeyError:
        return str(os.geteuid())


FileStamps = tuple[tuple[int, int, int], ...]


def file_stamps(options: MqttOptions) -> FileStamps:
    """Return a stamp of each file and of the message library; a stamp changes if its file is replaced or modified."""
    return tuple(_stamp(path) for path in (*(path for _, path, _ in options.files()), library_file()))


def _stamp(path: str) -> tuple[int, int, int]:
    try:
        found = os.stat(path)
    except OSError:
        return 0, 0, 0
    return found.st_ino, found.st_size, found.st_ctime_ns  # a change of the permissions changes st_ctime as well
