"""Messages between the station and its facilities process: tuples in marshal's format.

Both ends are the same program, so both have the same marshal, which takes a tenth of the time of JSON.

To the process, on the channel of its worker:

# ("ask", Ask)                 a request of a user
# ("want", address, topics)    ZeroMQ address of the received messages, and the topics that users subscribe to

On that address: Received.

From the process, on the channel of its worker:

# ("pdu", number, octets, type)            a request was encoded; type: of the message, as in envelopes
# ("refused", number, reason, detail, faults)  a request cannot be encoded
# ("json", topic, body)                    a message for users
# ("done", done, lost)                     numbers of received messages: handled in all, and lost of these
"""

import marshal
from typing import Any, NamedTuple, cast

MAX_BODY = 60 * 1024  # octets of a JSON object: with its other fields it fits into a message of a worker


class Ask(NamedTuple):
    """A request of a user in JSON, with what fills in a missing header, time or position.

    number      running number, returned with the answer.
    type        type of the envelope; empty for `v2x.`.
    message_id  messageID of this type; -1 for `v2x.`.
    form        one of JSON_FORMS.
    body        JSON object.
    station_id  own stationID.
    its_ms      own ITS time in ms; 0 if unknown.
    latitude    own latitude in 1e-7 degree; None if unknown.
    longitude   own longitude in 1e-7 degree; None if unknown.
    """

    number: int
    type: str
    message_id: int
    form: str
    body: bytes
    station_id: int
    its_ms: int
    latitude: int | None
    longitude: int | None


class Received(NamedTuple):
    """A received message with its metadata.

    number       running number: a gap shows messages that were lost on the way to the process.
    run          random text of this start of the station.
    sequence     number of the message among the delivered ones of its type.
    type         message type; empty for an unknown messageID.
    received_ns  Unix time of reception in ns.
    btp_port     BTP port; None if unknown.
    rssi_dbm     signal strength in dBm; None if unknown.
    source       MAC address of the sender, or its name at a broker; empty if unknown.
    latitude     latitude of the sender in 1e-7 degree; None if unknown.
    longitude    longitude of the sender in 1e-7 degree; None if unknown.
    security     name of the SecurityStatus.
    quality      quality of received_ns, as in reports.
    implausible  reasons why the message is implausible.
    """

    number: int
    run: str
    sequence: int
    type: str
    pdu: bytes
    interface: str
    received_ns: int
    btp_port: int | None
    rssi_dbm: int | None
    source: str
    latitude: int | None
    longitude: int | None
    security: str
    quality: dict[str, object]
    implausible: tuple[str, ...]


def reception_of(one: Received) -> dict[str, object]:
    """Return how a message was received.

    run          random text of each start of the station; another one shows that the station was restarted.
    sequence     number of the message among the delivered ones of its type since the start: a gap shows missed ones.
    interface    interface that received it.
    received_ns  Unix time of reception in ns.
    quality      quality of received_ns, as in `indication.`.
    btp_port     BTP port; null if unknown.
    rssi_dbm     signal strength in dBm; null if unknown.
    source       MAC address of the sender, or its name at a broker; empty if unknown.
    position     position of the sender in degrees by the packet's header; null if unknown.
    security     result of the check of the signature: `none`, `invalid_fmt`, `verified_pkt` or `unverifiable_pkt`.
    implausible  reasons why the message is implausible; absent for a plausible message.
    """
    position = None
    if one.latitude is not None and one.longitude is not None:
        position = {"latitude": one.latitude / 1e7, "longitude": one.longitude / 1e7}
    told: dict[str, object] = {
        "run": one.run,
        "sequence": one.sequence,
        "interface": one.interface,
        "received_ns": one.received_ns,
        "quality": one.quality,
        "btp_port": one.btp_port,
        "rssi_dbm": one.rssi_dbm,
        "source": one.source,
        "position": position,
        "security": one.security.lower(),
    }
    return told | {"implausible": one.implausible} if one.implausible else told


def packed(*parts: Any) -> bytes:
    return marshal.dumps(parts)


def parts_of(message: bytes) -> tuple[object, ...]:
    return cast("tuple[object, ...]", marshal.loads(message))
