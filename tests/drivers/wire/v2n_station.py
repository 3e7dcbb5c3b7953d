"""Stations with a profile to talk about, and PDUs of other implementations."""

import copy
from typing import Any

from drivers.message import Ego, Position
from drivers.mqtt_profile import codec, load
from drivers.wire.v2n import Delivery, Identity, Profile, Publication
from drivers.wire.v2n_description import ProfileDescription

HERE = Ego(its_ms=0, position=Position(487668616, 114320680), is_known=True)
NOWHERE = Ego(its_ms=0, position=Position(), is_known=False)
NOW_MS = 1_700_000_000_000
PDU = bytes.fromhex("02020000053900010203")  # of the contract's example


def profile(
    name: str | ProfileDescription, host: str = "vm", station: int = 1, uuid: str = "com_car_1", prefix: str = ""
) -> Profile:
    description = load(name) if isinstance(name, str) else name
    return Profile(description, Identity(host, station, uuid, prefix), codec(description))


def delivered(publication: Publication, topic: str = "", is_retained: bool = False) -> Delivery:
    """What a broker makes of it, and a back end that moves it to another topic."""
    return Delivery(topic or publication.topic, publication.payload, is_retained)


def changed(message: dict[str, Any], path: str, value: Any) -> dict[str, Any]:
    """A copy with another value at a path of members; ...: without it."""
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
