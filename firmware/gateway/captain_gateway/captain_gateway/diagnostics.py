"""Diagnostics: publishes statuses once a second, and checks other nodes' types on the topics."""

from collections.abc import Callable, Mapping
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from . import diagnosis
from .channel import Channel
from .counts import Counts
from .diagnosis import Status
from .peers import peer, strangers
from .timers import every

PERIOD_S = 1.0
PEERS_S = 2.0


class Diagnostics:
    """Publisher of /diagnostics, once per second; also checks the types of other nodes every 2 s.

    publisher  of DiagnosticArray.
    others     returns the statuses that do not belong to a handler.
    """

    def __init__(
        self, node: Any, publisher: Any, channels: Mapping[str, Channel], others: Callable[[], list[Status]]
    ) -> None:
        self._node = node
        self._publisher = publisher
        self._channels = channels
        self._others = others
        self._since = {name: Counts() for name in channels}
        self._strangers: dict[str, list[str]] = {name: [] for name in channels}
        every(node, PERIOD_S, self._say)
        every(node, PEERS_S, self._look_at_peers)

    def _say(self) -> None:
        said = self._others()
        for name, channel in self._channels.items():
            counts, since = channel.counts.now(), self._since[name]
            active = channel.receiving.active, channel.transmitting.active
            said.append(diagnosis.of_handler(name, counts, since, self._strangers[name], active))
            self._since[name] = counts
        message = DiagnosticArray()
        message.header.stamp = self._node.get_clock().now().to_msg()
        message.status = [self._status(one) for one in said]
        self._publisher.publish(message)

    def _status(self, one: Status) -> DiagnosticStatus:
        return DiagnosticStatus(
            level=bytes([one.level]),
            name=f"{self._node.get_fully_qualified_name().lstrip('/')}: {one.name}",
            message=one.message,
            hardware_id=self._node.get_fully_qualified_name().lstrip("/"),
            values=[KeyValue(key=key, value=value) for key, value in one.values.items()],
        )

    def _look_at_peers(self) -> None:
        for name, channel in self._channels.items():
            found = self._at(channel.subscription.topic_name, is_ours_subscribed=True)
            found += self._at(channel.publisher.topic_name, is_ours_subscribed=False)
            for line in found:
                if line not in self._strangers[name]:
                    self._node.get_logger().error(line)
            self._strangers[name] = found

    def _at(self, topic: str, is_ours_subscribed: bool) -> list[str]:
        publishers = [peer(one) for one in self._node.get_publishers_info_by_topic(topic)]
        subscriptions = [peer(one) for one in self._node.get_subscriptions_info_by_topic(topic)]
        ours, theirs = (subscriptions, publishers) if is_ours_subscribed else (publishers, subscriptions)
        me = self._node.get_fully_qualified_name()
        return strangers(topic, [one for one in ours if one.node == me], theirs)
