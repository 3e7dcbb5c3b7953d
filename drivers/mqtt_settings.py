"""What the process with the MQTT client is told first: the options of its interface, made whole, and a little more."""

import json
import os
import re
import uuid
from dataclasses import asdict, dataclass, replace

from board.describe import read
from drivers.contract import Shared
from drivers.mqtt_options import KEEP_ALIVE_S, MqttOptions

# A connection that a tunnel or another address has cut says nothing. Given up so soon, another one is there before TCP
# would have tried again, and no octets arrive in it that were written much longer ago.
STALL_S = 3.0


@dataclass(frozen=True)
class MqttSettings(MqttOptions):
    """Options of which none is left open, and what is not for a user to say. Paths are as options have them.

    types       names of the message types by their row; "" where one has none. ToSend.row is a place in it.
    urgent      messageIDs of what is dropped last on its way to the station.
    connect_s   limit of each of: name, TCP and TLS, CONNACK, SUBACK.
    stall_s     what was written and nobody's kernel has acknowledged for so long ends the connection.
    first_delay_s, longest_delay_s    of the back-off between two tries.
    """

    types: tuple[str, ...] = ()
    urgent: tuple[int, ...] = (1,)
    keep_alive_s: int = KEEP_ALIVE_S  # shorter than a user's may be, for those who cannot wait
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


def settings_of(options: MqttOptions, shared: Shared) -> MqttSettings:
    """The settings of an interface, with what its options leave out."""
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
    """This machine's, without what the kernel allows in one and a topic does not."""
    return re.sub(r"[^A-Za-z0-9._-]", "-", os.uname().nodename)
