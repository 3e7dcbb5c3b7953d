"""ROS node of the gateway: connects topics, handlers and a station's endpoint."""

import socket
import time
from types import ModuleType
from typing import Any

import rclpy
import rclpy.executors
import zmq
from diagnostic_msgs.msg import DiagnosticArray

from . import diagnosis, handlers, installed, metadata, settings
from .channel import Channel, period_s
from .codec import ITS_HEADER, Edition
from .counts import Complaints, Tally
from .diagnostics import Diagnostics
from .endpoint import Address, Receiving, Sending
from .errors import GatewayError
from .own_topics import OwnTopics
from .pairing import Arrival, How, Joining, Key, RawReader, Waiting, key
from .parameters import Parameters
from .refusals import in_words
from .requests import Requests
from .routing import Routing
from .services import Services
from .timers import every
from .topics import WAYS, Topics

MOST_TYPES = 64  # most types without a handler that are counted by name


class Gateway:
    """The node's objects: parameters, handlers, topics, services, sockets.

    Raises GatewayError for errors of the user.
    """

    def __init__(self, node: Any, library: ModuleType) -> None:
        self._node = node
        self._log = node.get_logger()
        self._parameters = Parameters(node)
        chosen = self._parameters.gateway()
        self._chosen = chosen
        self._profile: str = chosen["profile"]
        if chosen["lists"] and self._profile != "v2x_msgs":
            raise GatewayError(f"parameter lists: {self._profile} has no lists, v2x_msgs has")
        self._complaints = Complaints(chosen["log.throttle_s"])
        self._topics = Topics(node, {way: chosen[f"topics.{way}"] for way in WAYS})
        self.publisher, self.subscription = self._topics.publisher, self._topics.subscription
        frames = chosen["frames.map"], chosen["frames.station"]
        self._frame = frames[1].encode("ascii", "replace")
        self.own = OwnTopics(node, frames, chosen["own.origin"], chosen["own.transform"], self.publisher)
        self._messages = installed.interfaces()
        self.channels = self._make_channels(library)
        self._routing = Routing(self.channels.values())
        self._without = Tally(MOST_TYPES)
        self._waiting = Waiting()
        self._told: dict[str, object] = {}
        self._is_there: bool | None = None
        self._label_number = 0
        self._label_prefix = f"ros:{socket.gethostname()}:{node.get_fully_qualified_name()}:{time.time_ns():x}:"
        self._requests = None
        if self._messages is not None:
            self._requests = Requests(self, self._messages, Services(library, self._profile, self.channels))
        self.context: zmq.Context[Any] = zmq.Context()
        self.address = Address(*(chosen[f"station.{name}"] for name in Address._fields))
        self._joining = Joining(RawReader(library))
        self._sending = Sending(self.context, self.address)
        self._receiving = Receiving(self.context, self.address, self._joining, self)
        self._parameters.on_change(self._changed)
        self._diagnostics = Diagnostics(
            node, self.publisher(DiagnosticArray, "/diagnostics"), self.channels, self._others
        )

    @property
    def node(self) -> Any:
        return self._node

    def start(self) -> None:
        self._receiving.start()
        if self._messages is None:
            self._log.warning(
                "captain_gateway_msgs is not installed: no metadata, no requests with options, no services; build it "
                "by colcon, as captain_gateway"
            )
        for name in self._parameters.unknown():
            self._log.warning(f"parameter {name}: unknown; it is ignored")
        names = ", ".join(f"{channel.kind.name} ({channel.edition.name})" for channel in self.channels.values())
        self._log.info(f"gateway to {self.address.url(self.address.to_users)}: {names}")

    def close(self) -> None:
        """Stop. Messages already handed to the socket are still sent; nothing more is published.

        May be called twice.
        """
        self._receiving.end()
        self._sending.close()
        self.context.term()

    # -- topics

    def _make_channels(self, library: ModuleType) -> dict[str, Channel]:
        made: dict[str, Channel] = {}
        absent: list[str] = []
        for name in self._chosen["handlers"]:
            kind = handlers.KINDS[name]
            values = self._parameters.handler(name)
            try:
                edition = Edition(library, values["edition"] or kind.editions[0], self._profile, kind)
            except GatewayError:
                if values["edition"]:
                    raise  # the user named this edition; a default is skipped instead
                absent.append(f"{name} (not in the message library)")
                continue
            type_ = installed.message(edition.ros_type + ("List" if self._chosen["lists"] else ""))
            if type_ is None:
                absent.append(f"{name} ({edition.ros_type.split('/', maxsplit=1)[0]})")
                continue
            made[name] = self._make_channel(name, edition, type_, values)
        if absent:
            self._log.info(f"without topics, because the message packages are not installed: {', '.join(absent)}")
        if not made:
            raise GatewayError(
                f"no message package is installed of {', '.join(absent) or 'any handler'}; generate them: captain-asn1 "
                "generate cam-1.4.1 denm-1.3.1 --format ros2 --to DIR. Then run colcon build, and source its setup file"
            )
        return made

    def _make_channel(self, name: str, edition: Edition, type_: Any, values: dict[str, Any]) -> Channel:
        channel = Channel(
            handlers.KINDS[name], edition, settings.receive(values), settings.transmit(values),
            self.own, self._complaints, self._log.warning,
        )  # fmt: skip
        channel.station_id = self._chosen["station_id"]
        channel.frame = self._frame if self._chosen["lists"] else None
        channel.send = self.send
        channel.values = values
        word = values["topic"] or name
        channel.publisher = self.publisher(type_, self._topics.name("received", name, word))
        if self._messages is not None:
            channel.metadata = self.publisher(self._messages.msg.Metadata, self._topics.name("metadata", name, word))
        channel.subscription = self.subscription(
            type_, self._topics.name("transmitted", name, word), channel.transmit, is_raw=True
        )
        self._set_timer(channel)
        return channel

    def _set_timer(self, channel: Channel) -> None:
        if channel.timer is not None:
            self._node.destroy_timer(channel.timer)
            channel.timer = None
        if channel.transmitting.rate_hz:
            channel.timer = every(self._node, period_s(channel.transmitting), channel.period)

    # -- from the station, in the thread that receives

    def arrived(self, arrival: Arrival) -> None:
        is_long = len(arrival.pdu) >= ITS_HEADER
        channel, edition = self._routing.find_edition(arrival.pdu) if is_long else (None, None)
        if channel is None:
            name = arrival.type or f"messageID {arrival.pdu[1]}" if is_long else "too short"
            self._without.count(name)
            return
        note = channel.receive(arrival, edition)
        if note is None:
            return
        if not self.address.report or arrival.reception is None:
            self._publish_note(channel, note, None)
            return
        how = self._waiting.message(key(arrival.pdu, arrival.reception.received_ns), (channel, note), time.monotonic())
        if how is not None:
            self._publish_note(channel, note, how)

    def indicated(self, key: Key, how: How) -> None:
        found = self._waiting.indication(key, how)
        if found is not None:
            channel, note = found
            self._publish_note(channel, note, how)

    def reported(self, topic: str, told: dict[str, Any]) -> None:
        if topic == "status.":
            self._told = told
            self.own.status(told)
        elif topic == "time.":
            self.own.time(told)
        elif topic.startswith("confirm."):
            label = told.get("label")
            if isinstance(label, str) and label.startswith(self._label_prefix):
                self._confirmed(told, label)

    def present(self, is_there: bool) -> None:
        where = self.address.url(self.address.to_users)
        if is_there:
            self._log.info(f"a station is heard at {where}")
        elif self._is_there is not None:
            self._log.error(f"the station at {where} is silent: no heartbeat for 3 s; nothing is sent until it is back")
        else:
            self._log.warning(f"no station is heard at {where}; check that `captain run` runs there, and station.host")
        self._is_there = is_there
        self._sending.is_silent = not is_there

    def passed(self) -> bool:
        if self._waiting.is_empty:
            return False
        for channel, note in self._waiting.expired(time.monotonic()):
            self._publish_note(channel, note, None)
        return True

    def _publish_note(self, channel: Channel, note: metadata.Note, how: How | None) -> None:
        channel.metadata.publish(metadata.cdr(note, how, self._frame))

    def _confirmed(self, told: dict[str, Any], label: str) -> None:
        name, _, users = label.removeprefix(self._label_prefix).partition(":")
        name = name.partition("#")[0]
        channel = self.channels.get(name)
        if channel is not None:
            channel.confirmed(told)
        if self._requests is not None:
            self._requests.confirm(told, users)

    # -- to the station, in the executor's thread

    def send(self, channel: Channel, pdu: bytes, asked: dict[str, object], label: str = "") -> None:
        """Send a PDU. Raises RefusedError if no station takes it."""
        if self._chosen["confirms"] and self.address.report:
            self._label_number += 1
            asked["label"] = f"{self._label_prefix}{channel.kind.name}#{self._label_number}:{label}"
        self._sending.send(pdu, asked)

    def complain(self, about: str, cause: str, text: str) -> None:
        line = self._complaints.say(about, cause, text, time.monotonic())
        if line is not None:
            self._log.warning(line)

    # -- parameters, diagnostics

    def _changed(self, name: str, value: Any) -> None:
        if name == "log.throttle_s":
            self._complaints.period_s = float(value)
        elif name == "station_id":
            for channel in self.channels.values():
                channel.station_id = value
        head, _, rest = name.partition(".")
        if head in self.channels and rest in settings.HANDLER:
            self._channel_changed(self.channels[head], rest, value)

    def _channel_changed(self, channel: Channel, rest: str, value: Any) -> None:
        channel.values[rest] = value
        if rest.startswith("receive."):
            channel.receiving = settings.receive(channel.values)
            return
        before = channel.transmitting.rate_hz
        channel.set_transmitting(settings.transmit(channel.values))
        if channel.transmitting.rate_hz != before:
            self._set_timer(channel)

    def _others(self) -> list[diagnosis.Status]:
        """Return the statuses of station and requests. Raise the error of the receiving thread, which ends the node."""
        if self._receiving.error is not None:
            raise self._receiving.error
        more = {f"without a handler: {name}": str(count) for name, count in sorted(self._without.now().items())}
        if self.own.why_no_transform:
            more["transform"] = f"none: {self.own.why_no_transform}"
        where, joining = self.address.url(self.address.to_users), self._joining
        said = [diagnosis.of_station(where, self._is_there, self._told, joining.rubbish, joining.sample, more)]
        return said if self._requests is None else [*said, self._requests.diagnosis()]


def run(arguments: list[str], library: ModuleType) -> None:
    """Run the node until it is interrupted. Raises GatewayError for errors of the user."""
    node = _node(arguments)
    gateway = None
    try:
        gateway = Gateway(node, library)
        gateway.start()
        rclpy.spin(node)
    except (KeyboardInterrupt, rclpy.executors.ExternalShutdownException):
        pass
    finally:
        if gateway is not None:
            gateway.close()
        node.destroy_node()
        rclpy.try_shutdown()


def _node(arguments: list[str]) -> Any:
    """Create the node. Raises GatewayError for arguments and parameter files that rclpy refuses."""
    with in_words("arguments of ROS"):
        rclpy.init(args=arguments)
        return rclpy.create_node("captain_gateway")
