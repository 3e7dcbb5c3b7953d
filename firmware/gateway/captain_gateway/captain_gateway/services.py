"""Services that convert a ROS message or JSON to a PDU, and back."""

from collections.abc import Iterable, Mapping
from types import ModuleType
from typing import Any

from .codec import ITS_HEADER, Edition
from .errors import GatewayError, RefusedError
from .handlers import KINDS
from .handlers.kind import Kind
from .routing import HasEdition, Routing


class Services:
    """Callbacks of the services `encode` and `decode`, for every edition of the library, also those without topics.

    editions  objects with an edition, by the name of their handler: those with topics.
    """

    def __init__(self, library: ModuleType, profile: str, editions: Mapping[str, HasEdition]) -> None:
        self._library = library
        self._profile = profile
        self._editions = editions
        self._routing = Routing(editions.values())

    def encode(self, request: Any, response: Any) -> Any:
        """Fill a response of captain_gateway_msgs/srv/Encode."""
        try:
            edition = self.edition(request.type)
            pdu = edition.message.from_json(request.json) if request.json else edition.from_cdr(bytes(request.cdr))
            edition.check_header(pdu)
            response.edition = edition.name
            response.pdu = pdu
            response.success = True
        except (GatewayError, RefusedError, ValueError, MemoryError) as error:
            response.reason = str(error)
        return response

    def decode(self, request: Any, response: Any) -> Any:
        """Fill a response of captain_gateway_msgs/srv/Decode."""
        pdu = bytes(request.pdu)
        try:
            edition = self.edition(request.type) if request.type else self._by_header(pdu)
            edition = edition if request.type == edition.name else edition.of(pdu)
            if edition.message.ids and len(pdu) >= ITS_HEADER:
                edition.check_header(pdu)
            response.cdr, left_out = edition.message.to_cdr(pdu, self._profile)
            response.json = edition.message.to_json(pdu)
            response.left_out = [part.path for part in left_out]
            response.edition, response.type = edition.name, edition.ros_type
            if others := edition.others(pdu) if edition.message.ids and len(pdu) >= ITS_HEADER else ():
                named = " and ".join((edition.name, *others))
                response.reason = f"warning: ambiguous edition: {named} decode it to different values"
            response.success = True
        except (GatewayError, RefusedError, ValueError, MemoryError) as error:
            response.reason = str(error)
        return response

    def edition(self, name: str) -> Edition:
        """Return the edition with the name of a handler, an edition or a ROS type.

        Raises GatewayError for an unknown name.
        """
        found = self._editions.get(name)
        if found is not None:
            return found.edition
        for edition in self._all():
            if name in (edition.name, edition.ros_type):
                return edition
        raise GatewayError(
            f"type {name!r} is neither a handler ({', '.join(self._editions)}) nor an edition as cam-1.4.1 nor a ROS "
            "type as etsi_its_cam_msgs/msg/CAM"
        )

    def _by_header(self, pdu: bytes) -> Edition:
        if len(pdu) < ITS_HEADER:
            raise GatewayError(f"{len(pdu)} octets are too short; the header alone has {ITS_HEADER}")
        found = self._routing.find(pdu)
        if found is not None and pdu[0] in found.edition.message.versions:
            return found.edition
        fits = [edition for edition in self._all() if pdu[1] in edition.message.ids]
        for edition in fits:
            if pdu[0] in edition.message.versions:
                return edition
        if found is not None or fits:
            return found.edition if found is not None else fits[0]
        raise GatewayError(f"no message has messageID {pdu[1]}; name its type")

    def _all(self) -> Iterable[Edition]:
        for message in self._library.all():
            try:
                yield Edition(
                    self._library, message.name, self._profile, KINDS.get(message.type) or Kind(message.type, ())
                )
            except GatewayError:
                continue  # this profile has no ROS type for it
