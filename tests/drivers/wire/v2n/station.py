"""Stations with a profile, and PDUs of other implementations, for tests."""

import base64
import copy
import json
from pathlib import Path
from typing import Any

import firmware
from drivers.message import Ego, Position
from drivers.mqtt.profile import codec, load
from drivers.wire.v2n.description import ProfileDescription
from drivers.wire.v2n.profile import Delivery, Identity, Profile, Publication

HERE = Ego(its_ms=0, position=Position(487668616, 114320680), is_known=True)
NOWHERE = Ego(its_ms=0, position=Position(), is_known=False)
NOW_MS = 1_700_000_000_000
PDU = bytes.fromhex("02020000053900010203")  # example of the contract
VECTORS = [
    (vector["type"].lower(), bytes.fromhex(vector["hex"]))
    for vector in json.loads((Path(firmware.__file__).parent / "vectors.json").read_text())
]
# Messages that Orange's JSON cannot represent, by type and octets: a path point too old, TR 103 562, protocolVersion 9.
WITHOUT_JSON = {
    ("denm", 404): "message.location.detection_zones_to_event_position[0][0].path_delta_time: 71316 is not in 1..65535",
    ("cpm", 624): "message: CPM of TR 103 562 has no form",
    ("mapem", 8): "no edition reads it",
}
# A CPM of TS 103 324 with an object, as `captain swarm` writes it.
CPM = bytes.fromhex(
    "020e000005390286567e700295b1244390d1b94032032000109a079003005a12415008058000003c002000003180fa80c681b0262ad890"
)
SENDABLE = [*((kind, pdu) for kind, pdu in VECTORS if (kind, len(pdu)) not in WITHOUT_JSON), ("cpm", CPM)]
# A message of each type that Orange's schemas define only as JSON, and the types for which they have no valid form.
AS_JSON = {kind: pdu for kind, pdu in SENDABLE if kind in ("denm", "cpm", "spatem", "mapem")}
WITHOUT_FORM = ("srem", "ssem")


def profile(
    name: str | ProfileDescription, host: str = "vm", station: int = 1, uuid: str = "com_car_1", prefix: str = ""
) -> Profile:
    description = load(name) if isinstance(name, str) else name
    return Profile(description, Identity(host, station, uuid, prefix), codec(description))


def delivered(publication: Publication, topic: str = "", is_retained: bool = False) -> Delivery:
    """Return a publication as the broker delivers it. topic: another topic to which a back end moved it."""
    return Delivery(topic or publication.topic, publication.payload, is_retained)


def in_envelope(kind: str, pdu: bytes, uuid: str = "com_car_2") -> dict[str, Any]:
    """Return Orange's envelope with the PDU in base64, as another implementation may send it for any type."""
    return {
        "message_type": kind,
        "message_format": "asn1/uper",
        "source_uuid": uuid,
        "timestamp": NOW_MS,
        "version": "2.0.0",
        "message": {"version": "?", "payload": base64.b64encode(pdu).decode()},
    }


def changed(message: dict[str, Any], path: str, value: Any) -> dict[str, Any]:
    """Return a copy with another value at a path of members; `...` removes the member."""
    body = copy.deepcopy(message)
    *way, last = path.split(".")
    holder: Any = body
    for step in way:
        holder = holder[step]
    if value is ...:
        del holder[last]
    else:
        holder[last] = value
    return body
