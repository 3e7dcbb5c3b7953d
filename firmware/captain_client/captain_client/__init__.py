"""Client of a V2X station: sends and receives messages with their outcome."""

from captain_client.address import Address
from captain_client.errors import RefusedError, StationError, UnconfirmedError, UnreachableError
from captain_client.message import Message
from captain_client.reports import Frame
from captain_client.requests import Confirmed
from captain_client.station import Sent, Station, Subscription

__all__ = [
    "Address",
    "Confirmed",
    "Frame",
    "Message",
    "RefusedError",
    "Sent",
    "Station",
    "StationError",
    "Subscription",
    "UnconfirmedError",
    "UnreachableError",
]
