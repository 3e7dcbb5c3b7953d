"""Settings of the MQTT process: the complete options of its interface, and identity."""

import json
import os
import re
import uuid
from dataclasses import asdict, dataclass, replace

from board.runtime.describe import read
from drivers.contract import Shared
from drivers.mqtt.options import KEEP_ALIVE_S, MqttOptions

# Time limit for the acknowledgement of written octets. A connection that was cut by a tunnel or by a new address
# reports no error. With this limit a new connection is up before TCP would have tried again. Octets written much
# earlier do not arrive.
STALL_S = 3.0


@dataclass(frozen=True)
class MqttSettings(MqttOptions):
    """Options with all defaults filled in, and settings that a user cannot change; paths are those of the options.

    types            names of the message types by their row; "" for a type without a name. ToSend.row is an index of
                     it.
    urgent           messageIDs of messages that are dropped last on their way to the station.
    connect_s        time limit of each of: connection (name, TCP, TLS), CONNACK, SUBACK.
    stall_s          a connection is ended if written octets stay unacknowledged for this time.
    first_delay_s    first delay of the back-off between two tries.
    longest_delay_s  longest delay of the back-off.
    """

    types: tuple[str, ...] = ()
    urgent: tuple[int, ...] = (1,)
    keep_alive_s: int = KEEP_ALIVE_S  # without the option's lower limit of 5 s, for programs that cannot wait
    connect_s: float = 10.0
    stall_s: float = STALL_S
    first_delay_s: float = 0.5
    longest_delay_s: float = 30.0

    def type_of(self, row: int) -> str:
        """Return the name of the type of a row; empty for a type that was added after the start of the station."""
        return self.types[row] if row < len(self.types) else ""

    def message(self) -> bytes:
        """Return the settings as a JSON object: the first message to the process."""
        given = asdict(self)
        return json.dumps({key: value for key, value in given.items() if value is not None}).encode()


def settings_in(message: bytes) -> MqttSettings:
    """Parse the first message to the process; the inverse of MqttSettings.message()."""
    return read(MqttSettings, json.loads(message), "settings of the MQTT process")


def settings_of(options: MqttOptions, shared: Shared) -> MqttSettings:
    """Return the settings of an interface; client_id, host, station and uuid get defaults if the options lack them."""
    client_id = options.client_id or _own_name()
    made_uuid = uuid.uuid5(uuid.NAMESPACE_URL, f"{shared.mac.hex()}/{client_id}")
    whole = replace(
        options,
        client_id=client_id,
        host=options.host or client_id,
        station=options.station or int.from_bytes(shared.mac[2:]),
        uuid=options.uuid or str(made_uuid),
    )
    urgent = tuple(sorted(shared.lanes[0])) if shared.lanes else ()
    return MqttSettings(**vars(whole), types=shared.types, urgent=urgent)


def _own_name() -> str:
    """Return this machine's host name; characters that are not safe in a topic are replaced by dashes."""
    return re.sub(r"[^A-Za-z0-9._-]", "-", os.uname().nodename)
