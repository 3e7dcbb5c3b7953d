"""What the MQTT driver tells its process first: one JSON object, made and read here."""

import json
from dataclasses import asdict, dataclass
from ipaddress import ip_address
from typing import Literal, NamedTuple
from urllib.parse import SplitResult, urlsplit

from board.describe import read
from board.errors import ConfigurationError

PORTS = {"mqtt": 1883, "mqtts": 8883}  # IANA's, for a URL without one

KEEP_ALIVE_S = 20  # mobile networks forget an idle TCP connection after 30 s and more
SESSION_EXPIRY_S = 30  # of a session that is kept: what arrives late is passed on as if it were new
IN_FLIGHT = 20  # publications without an acknowledgement

# A connection that a tunnel or another address has cut says nothing. Given up so soon, another one is there before TCP
# would have tried again, and no octets arrive in it that were written much longer ago.
STALL_S = 3.0


class Broker(NamedTuple):
    """Where a broker is."""

    host: str
    port: int
    has_tls: bool

    def __str__(self) -> str:
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{'mqtts' if self.has_tls else 'mqtt'}://{host}:{self.port}"

    @property
    def is_loopback(self) -> bool:
        """Whether it can only be this machine, whatever a name server says."""
        return is_loopback(self.host) or self.host == "localhost"


def is_loopback(host: str) -> bool:
    """Whether it is an address of this machine alone; a name is none."""
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return False


def broker(url: str) -> Broker:
    """The broker of `mqtts://host:port` or `mqtt://host:port`. Raises ConfigurationError."""
    wanted = "write for example mqtts://broker.example:8883, or mqtt://localhost:1883 without TLS"
    if "@" in url:  # and it is not shown: what is before that may be a password
        raise ConfigurationError("url: names a user", "name it in username and password_file")
    try:
        parts = urlsplit(url)
    except ValueError as error:
        raise ConfigurationError(f'url: "{url}" has a host in brackets that is no IPv6 address', wanted) from error
    if parts.scheme not in PORTS:
        raise ConfigurationError(f'url: "{url}" begins with neither mqtts:// nor mqtt://', wanted)
    if not parts.hostname or any(not "!" <= letter <= "~" for letter in url):
        raise ConfigurationError(f'url: "{url}" names no host', wanted)
    if parts.path.strip("/") or parts.query or parts.fragment:
        raise ConfigurationError(f'url: "{url}" goes on after the port', wanted)
    return Broker(parts.hostname, _port(parts) or PORTS[parts.scheme], parts.scheme == "mqtts")


def _port(parts: SplitResult) -> int | None:
    """None where there is none: the default is meant."""
    try:
        port = parts.port
    except ValueError:
        port = 0
    if port == 0:
        raise ConfigurationError(f'url: "{parts.geturl()}" has a port that is none', "a port is 1 to 65535")
    return port


@dataclass(frozen=True)
class MqttSettings:
    """What the process needs to know. Paths are absolute or of the station's working directory.

    url         of the broker, as broker() reads it.
    profile     name of one that is there, or the path of a TOML file.
    types       names of the message types by their row; "" where one has none. ToSend.row is a place in it.
    urgent      messageIDs of what is dropped last on its way to the station.
    client_id   unique per broker.
    host        of vcaptain's payload and status, and {host} of the templates.
    station     stationID, {station} of the templates. uuid and prefix: {uuid}, {prefix}.
    ca          file of certificates that sign brokers; "": those of the system.
    certificate, key    of this client, both or none.
    username, password_file    both or none; the file is read at each connect.
    version     of MQTT.
    clean       start without what an earlier session left; else the broker keeps it for session_expiry_s, by 3.1.1
                as long as it likes.
    qos         instead of the profile's; None: the profile's.
    device      that the connection is bound to (SO_BINDTODEVICE); "": the bearer's, or any without one.
    has_bearer  whether BEARER messages will come: until the first says up, nothing is connected.
    status_topic  instead of the profile's; "": the profile's.
    depths      least and most quadkey levels instead of the profile's; () for the profile's.
    in_flight   publications without an acknowledgement, at most.
    connect_s   limit of each of: name, TCP and TLS, CONNACK, SUBACK.
    stall_s     what was written and nobody's kernel has acknowledged for so long ends the connection.
    first_delay_s, longest_delay_s    of the back-off between two tries.
    """

    url: str
    profile: str = "vcaptain"
    types: tuple[str, ...] = ()
    urgent: tuple[int, ...] = (1,)
    client_id: str = ""
    host: str = ""
    station: int = 0
    uuid: str = ""
    prefix: str = ""
    ca: str = ""
    certificate: str = ""
    key: str = ""
    username: str = ""
    password_file: str = ""
    version: Literal[5, "3.1.1"] = 5
    keep_alive_s: int = KEEP_ALIVE_S
    clean: bool = True
    session_expiry_s: int = SESSION_EXPIRY_S
    qos: int | None = None
    device: str = ""
    has_bearer: bool = False
    status_topic: str = ""
    depths: tuple[int, ...] = ()
    in_flight: int = IN_FLIGHT
    connect_s: float = 10.0
    stall_s: float = STALL_S
    first_delay_s: float = 0.5
    longest_delay_s: float = 30.0

    def message(self) -> bytes:
        """The JSON object, the first message to the process."""
        given = asdict(self)
        return json.dumps({key: value for key, value in given.items() if value is not None}).encode()


def settings_in(message: bytes) -> MqttSettings:
    """The other way."""
    return read(MqttSettings, json.loads(message), "settings of the MQTT process")
