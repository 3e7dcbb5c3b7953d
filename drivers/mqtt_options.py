"""Options of an interface with driver = "mqtt", and the files that they name."""

import os
import stat
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Literal

from board.address import check_device_name
from board.describe import Range, all_of, at_key, remedy
from board.errors import BlockedError, ConfigurationError
from drivers.mqtt_broker import broker
from drivers.mqtt_profile import check_editions, is_file, library_file, names
from drivers.wire.quadkey import MAX_DEPTH
from drivers.wire.v2n_message import MAX_SOURCE

KEEP_ALIVE_S = 20  # mobile networks forget an idle TCP connection after 30 s and more
SESSION_EXPIRY_S = 30  # of a session that is kept: what arrives late is passed on as if it were new
IN_FLIGHT = 20  # publications without an acknowledgement

OTHERS = 0o077  # permissions of group and others

# Why a letter must not be in a name.
_WILDCARD = "nothing can be published to a wildcard"
_BEFORE_PORT = "payloads have (port) behind it"
_WHY_NOT = {"+": _WILDCARD, "#": _WILDCARD, "/": "it is one level of a topic", "(": _BEFORE_PORT, ")": _BEFORE_PORT}

Depth = Annotated[int, Range(1, MAX_DEPTH)]


@dataclass(frozen=True)
class MqttOptions:
    """Options of an interface with driver = "mqtt".

    url          of the broker: "mqtts://broker.example:8883"; "mqtt://" is without TLS.
    profile      vcaptain, raw, orange or nap; or the path of a TOML file with another.
    client_id    unique per broker; empty: the host's name.
    host         that messages and status name as their sender; empty: the client_id.
    station      stationID, where topics of the profile have one; 0: made of the station's address.
    uuid         of this client, where messages of the profile have one, in whatever form its others have them; empty:
                 made of address and client_id.
    prefix       that topics begin with, where the profile lets them.
    ca           file of certificates that sign brokers; empty: those of the system.
    certificate, key  of this client, for a broker that asks for one; both or none.
    username     and password_file, where the broker asks for them.
    version      of MQTT: 5 or "3.1.1".
    keep_alive_s  a broker that is silent for twice that is gone.
    clean        false: the broker keeps for session_expiry_s, by 3.1.1 as long as it likes, what arrives while the
                 station is away, and delivers it as received then. The first connection of a station whose profile has
                 tiles starts clean all the same.
    qos          0 or 1 for all that is sent, in place of the profile's.
    plaintext    true: without TLS even to another machine.
    device       network device that the connection is bound to; empty: the bearer's, or any without one.
    bearer       interface with the modem that the connection goes by; empty: none is followed.
    status_topic  in place of the profile's: older boxes have "v2xstatus".
    depths       least and most quadkey levels, in place of the profile's: [14, 18].
    editions     of messages that are made of JSON, in place of the preferred ones of their types: ["cpm-2.1.1-ext"].
    max_in_flight  messages that the broker has not acknowledged; what waits beyond it waits in the queue.
    """

    url: str
    profile: str = "vcaptain"
    client_id: str = ""
    host: str = ""
    station: Annotated[int, Range(0, 4_294_967_295)] = 0
    uuid: str = ""
    prefix: str = ""
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
        """Raises ConfigurationError with a line for each mistake."""
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
            hint = "write mqtts://, or plaintext = true where everybody on the way may read and change messages"
            raise ConfigurationError(f'url: "{self.url}" is without TLS to another machine', hint)
        for name in ("ca", "certificate", "key"):
            if getattr(self, name):
                raise ConfigurationError(f'{name}: there is no TLS in "{self.url}"', "write mqtts://, or leave it out")

    def _check_profile(self) -> None:
        if not is_file(self.profile) and self.profile not in names():
            hint = f"{remedy(self.profile, names())}; the path of a profile of your own ends in .toml"
            raise ConfigurationError(f'profile: there is no "{self.profile}"', hint)

    def _check_name(self, name: str) -> None:
        word, is_topic = getattr(self, name), name in ("prefix", "status_topic")
        _check_word(name, word, "+# " if is_topic else "/+#() ")
        if is_topic and word.startswith("$"):
            raise ConfigurationError(f"{name}: {word!r} begins with $", "such topics are the broker's own")

    def _check_pair(self, one: str, other: str) -> None:
        if bool(getattr(self, one)) != bool(getattr(self, other)):
            given, missing = (one, other) if getattr(self, one) else (other, one)
            raise ConfigurationError(f"{given} is given without {missing}", "give both or none")

    def _check_depths(self) -> None:
        if self.depths and (len(self.depths) != 2 or self.depths[0] > self.depths[1]):
            raise ConfigurationError(f"depths: {list(self.depths)} is not the least and the most", "write [14, 18]")

    def files(self) -> Iterator[tuple[str, str, bool]]:
        """Those that options name: the option, the path, and whether only its owner may read it."""
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
    """Raises BlockedError for one that is not there, that cannot be read, or that others may read and must not."""
    for name, path, is_secret in options.files():
        check_file(name, path, is_secret)


def check_file(name: str, path: str, is_secret: bool) -> None:
    """As check_files() does for one of MqttOptions.files(). Nothing is opened: a FIFO would wait."""
    try:
        mode = os.stat(path).st_mode
    except OSError as error:
        hint = f"correct option {name}, or put the file there"
        raise BlockedError(f"{name} {path}: {error.strerror}", hint) from error
    if not stat.S_ISREG(mode):
        raise BlockedError(f"{name} {path}: is no regular file", f"correct option {name}")
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
    """Others when any of the files, or the message library, is another or has another content."""
    return tuple(_stamp(path) for path in (*(path for _, path, _ in options.files()), library_file()))


def _stamp(path: str) -> tuple[int, int, int]:
    try:
        found = os.stat(path)
    except OSError:
        return 0, 0, 0
    return found.st_ino, found.st_size, found.st_ctime_ns  # which a change of its mode changes too
