"""Topics of the node: how they are called, and their quality of service."""

from collections.abc import Callable, Mapping
from typing import Any

from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions

from .errors import GatewayError
from .refusals import in_words

WAYS = ("received", "transmitted", "metadata")
# Of every topic: reliable, and the last 100 kept for a node that is late; ten seconds of a station's messages.
DEPTH = 100


class Topics:
    """Publishers and subscriptions of a node, which users may override. templates: of the names of each way."""

    def __init__(self, node: Any, templates: Mapping[str, str]) -> None:
        self._node = node
        self._templates = templates
        self._named: dict[str, str] = {}

    def name(self, way: str, handler: str, word: str) -> str:
        """Of a handler's topic; word: what stands for {type}.

        Raises GatewayError where two have one name, by remapping as well: what is received would be sent again.
        """
        topic = self._templates[way].replace("{type}", word)
        what = f"{handler}: topics.{way}"
        with in_words(what):
            full_name = self._node.resolve_topic_name(topic)
        other = self._named.setdefault(full_name, what)
        if other != what:
            raise GatewayError(f"{other} and {what} are one topic, {full_name}: nobody could tell one from the other")
        return topic

    def publisher(self, type_: Any, topic: str) -> Any:
        """Raises GatewayError."""
        with in_words(topic):
            return self._node.create_publisher(type_, topic, _qos(), qos_overriding_options=_overridable())

    def subscription(self, type_: Any, topic: str, call: Callable[[Any], None], is_raw: bool = False) -> Any:
        """Raises GatewayError."""
        with in_words(topic):
            return self._node.create_subscription(
                type_, topic, call, _qos(), raw=is_raw, qos_overriding_options=_overridable()
            )


def _qos() -> QoSProfile:
    return QoSProfile(depth=DEPTH, reliability=ReliabilityPolicy.RELIABLE)


def _overridable() -> QoSOverridingOptions:
    return QoSOverridingOptions.with_default_policies()
