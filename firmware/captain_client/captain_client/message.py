"""Received message: PDU and metadata; decodes its values on demand."""

from functools import cached_property
from typing import Any

from captain_client.codec import Decoded, value_at
from captain_client.errors import StationError

ITS_HEADER = 6  # octets: protocolVersion, messageID, stationID


class Message:
    """Message that the station has received and delivered.

    A further attribute is a component of the message with the values of the standard: `message.cam.camParameters`. The
    view of captain_messages gives it. Without captain_messages, only metadata and PDU are available.

    pdu          octets of the message.
    type         message type; empty if unknown.
    missed       number of messages of this type that were missed since the previous one.
    interface    interface that received it.
    received_ns  Unix time of reception in ns.
    quality      quality of received_ns: state, error_ns, offset_ns, uncertainty_ns.
    btp_port     BTP port; None if unknown.
    rssi_dbm     signal strength in dBm; None if unknown.
    source       MAC address of the sender, or its name at a broker; empty if unknown.
    position     latitude and longitude of the sender in degrees by the packet's header; None if unknown.
    security     result of the check of the signature, such as `none`.
    data_rate    data rate in 500 kbit/s; 0 if unknown.
    traffic_class  traffic class of the packet; 0 if unknown.
    hop_limit    remaining hop limit of the packet; 0 if unknown.
    implausible  reasons why it is implausible; empty for a plausible message.

    Raises KeyError or TypeError if the object of the station is malformed.
    """

    def __init__(self, pdu: bytes, told: dict[str, Any]) -> None:
        self.pdu = pdu
        self.missed = 0
        self.type: str = told["type"]
        self.interface: str = told["interface"]
        self.received_ns: int = told["received_ns"]
        self.quality: dict[str, Any] = told["quality"]
        self.btp_port: int | None = told["btp_port"]
        self.rssi_dbm: int | None = told["rssi_dbm"]
        self.source: str = told["source"]
        self.position: dict[str, float] | None = told["position"]
        self.security: str = told["security"]
        self.data_rate: int = told["data_rate"]
        self.traffic_class: int = told["traffic_class"]
        self.hop_limit: int = told["hop_limit"]
        self.implausible: tuple[str, ...] = tuple(told.get("implausible", ()))

    def __repr__(self) -> str:
        return f"<{self.type or 'message'} of station {self.station}, {len(self.pdu)} octets, by {self.interface}>"

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        return getattr(self._decoded.view, name)

    def __getstate__(self) -> dict[str, Any]:
        """Return the attributes for copies and pickles. A copy decodes again, because views have no copy."""
        return {name: value for name, value in vars(self).items() if name != "_decoded"}

    @property
    def station(self) -> int | None:
        """stationID of the ITS PDU header; None if the PDU is too short."""
        return int.from_bytes(self.pdu[2:ITS_HEADER], "big") if len(self.pdu) >= ITS_HEADER else None

    @property
    def error(self) -> str:
        """Reason why the message cannot be decoded; empty if it can."""
        try:
            self._decoded  # noqa: B018 - the access decodes
        except StationError as error:
            return str(error)
        return ""

    @property
    def edition(self) -> str:
        """Edition that fits best, such as `cam-1.4.1`; empty if the message cannot be decoded."""
        return "" if self.error else self._decoded.edition.name

    @cached_property
    def value(self) -> dict[str, Any]:
        """Message with the integers of the standard. Raises StationError if the message cannot be decoded."""
        return self._decoded.exact()

    @cached_property
    def plain(self) -> dict[str, Any]:
        """Message in SI units, degrees and names. Raises StationError if the message cannot be decoded."""
        return self._decoded.plain()

    def get(self, name: str) -> Any:
        """Return a value of `plain` by short name or path, such as `speed`; None if the message does not have it.

        Raises StationError if the message cannot be decoded, or its edition has no such short name.
        """
        return value_at(self.plain, self._decoded.path(name))

    @cached_property
    def _decoded(self) -> Decoded:
        return Decoded(self.pdu, self.type)
