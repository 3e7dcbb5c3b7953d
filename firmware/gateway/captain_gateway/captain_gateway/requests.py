"""Requests with options, confirms and services: the parts that need captain_gateway_msgs."""

from typing import Any, Protocol

from .channel import Channel
from .codec import ITS_HEADER
from .diagnosis import OK, WARN, Status
from .errors import GatewayError, RefusedError
from .routing import Routing
from .services import Services
from .told import number
from .values import MOST_ANGLE, MOST_DISTANCE

SHAPES = ("", "circle", "rectangle", "ellipse")  # index: number of the shape in Area.msg
MOST_TIME = 2.0**31 - 1  # builtin_interfaces/Time
LONGEST_LABEL = 256  # characters; a station reads at most 4096 octets of options


class Gateway(Protocol):
    """Members of the node that Requests uses."""

    channels: dict[str, Channel]

    @property
    def node(self) -> Any: ...
    def publisher(self, type_: Any, topic: str) -> Any: ...
    def subscription(self, type_: Any, topic: str, call: Any) -> Any: ...
    def complain(self, about: str, cause: str, text: str) -> None: ...


class Requests:
    """Topics `request` and `confirm`, and services `~/encode` and `~/decode`."""

    def __init__(self, gateway: Gateway, messages: Any, services: Services) -> None:
        self._gateway = gateway
        self._messages = messages
        self._routing = Routing(gateway.channels.values())
        self._taken = self._refused = self._refused_before = 0
        self._why = ""
        self._confirms = gateway.publisher(messages.msg.Confirm, "confirm")
        self._subscription = gateway.subscription(messages.msg.Request, "request", self._request)
        gateway.node.create_service(messages.srv.Encode, "~/encode", services.encode)
        gateway.node.create_service(messages.srv.Decode, "~/decode", services.decode)

    def confirm(self, told: dict[str, Any], label: str) -> None:
        """Publish a confirm of the station. Called in the receiving thread.

        told   the station's report.
        label  chosen by the user.
        """
        if not self._confirms.get_subscription_count():
            return
        message = self._messages.msg.Confirm(label=label)
        seconds, queue_us, send_us = (
            number(told, name, 0.0, MOST_TIME) or 0.0 for name in ("time", "queue_us", "send_us")
        )
        message.header.stamp.sec, message.header.stamp.nanosec = int(seconds), int(seconds % 1 * 1e9)
        for name in ("type", "outcome", "interface", "reason", "meaning", "detail"):
            setattr(message, name, str(told.get(name) or ""))
        message.queue, message.send = queue_us / 1e6, send_us / 1e6
        self._confirms.publish(message)

    def diagnosis(self) -> Status:
        is_fresh = self._refused > self._refused_before
        self._refused_before = self._refused
        values = {"taken": str(self._taken), "refused": str(self._refused)}
        if self._why:
            values["last refused"] = self._why
        return Status(WARN if is_fresh else OK, "request", self._why if is_fresh else "ok", values)

    def _request(self, request: Any) -> None:
        self._taken += 1
        try:
            self._hand_over(request)
        except (GatewayError, RefusedError) as error:
            self._refused += 1
            self._why = str(error)
            cause = error.cause if isinstance(error, RefusedError) else "type"
            self._gateway.complain("request", cause, f"not sent: {error}")

    def _hand_over(self, request: Any) -> None:
        options = asked(request)
        pdu = bytes(request.pdu)
        channel = self._channel(request.type, pdu)
        if not channel.transmitting.active:
            raise RefusedError("inactive", f"{channel.kind.name}.transmit.active is false")
        if pdu:
            pdu = channel.checked(pdu)
            channel.edition.of(pdu).check_body(pdu)
        else:
            pdu = channel.octets(bytes(request.cdr))
        channel.counts.taken += 1
        channel.hand_over(pdu, options, request.label)

    def _channel(self, type_: str, pdu: bytes) -> Channel:
        """Return the handler that `type_` names; without a type, the one that would receive the PDU.

        Raises RefusedError.
        """
        if not type_:
            if len(pdu) < ITS_HEADER:
                raise RefusedError("request", "neither type nor a message in pdu; give one of them")
            found = self._routing.find(pdu)
            if found is None:
                raise RefusedError("request", f"pdu: no handler has messageID {pdu[1]}")
            return found
        for channel in self._gateway.channels.values():
            if type_ in (channel.kind.name, channel.edition.name, channel.edition.ros_type):
                return channel
        raise RefusedError("request", f"type: {type_!r} is not one of {', '.join(self._gateway.channels)}")


def asked(request: Any) -> dict[str, object]:
    """Convert captain_gateway_msgs/msg/Request to options of the station's endpoint.

    Raises RefusedError for a label, priority, lifetime or area out of range, and for a hop_limit without area.
    """
    found: dict[str, object] = {}
    if len(request.label) > LONGEST_LABEL:
        raise RefusedError("request", f"label: {len(request.label)} characters; at most {LONGEST_LABEL} are allowed")
    if request.interfaces:
        found["interfaces"] = list(request.interfaces)
    if request.btp_port:
        found["btp_port"] = request.btp_port
    if request.traffic_class_is_present:
        found["traffic_class"] = request.traffic_class
    if request.priority_is_present:
        if request.priority > 7:
            raise RefusedError("request", f"priority: {request.priority} is out of range; 0 to 7")
        found["priority"] = request.priority
    if request.lifetime:
        if not 0.0 < request.lifetime <= 86400.0:
            raise RefusedError("request", f"lifetime: {request.lifetime:g} is out of range; 0 to 86400 s")
        found["lifetime_s"] = request.lifetime
    if request.area.shape:
        found["area"] = _area(request.area)
    if request.hop_limit:
        if not request.area.shape:
            raise RefusedError(
                "request", f"hop_limit: {request.hop_limit} needs an area, because only a GeoBroadcast has it"
            )
        found["hop_limit"] = request.hop_limit
    return found


def _area(area: Any) -> dict[str, object]:
    limits = {
        "shape": (1, 3),
        "latitude": (-90, 90),
        "longitude": (-180, 180),
        "distance_a": (1, MOST_DISTANCE),
        "angle": (0, MOST_ANGLE),
    }
    for name, (low, high) in limits.items():
        value = getattr(area, name)
        if not low <= value <= high:
            raise RefusedError("request", f"area.{name}: {value:g} is out of range; {low} to {high}")
    found = {"shape": SHAPES[area.shape]} | {
        name: getattr(area, name) for name in ("latitude", "longitude", "distance_a")
    }
    if found["shape"] != "circle":
        if not area.distance_b:
            raise RefusedError("request", f"area.distance_b: a {found['shape']} of 0 m is empty")
        found |= {"distance_b": area.distance_b, "angle": area.angle}
    return found
