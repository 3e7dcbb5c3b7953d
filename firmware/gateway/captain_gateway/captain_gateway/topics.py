"""Topics of the node: their names and quality of service."""

from collections.abc import Callable, Mapping
from typing import Any

from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions

from .errors import GatewayError
from .refusals import in_words

WAYS = ("received", "transmitted", "metadata")
# Queue length of every topic, for a node that reads late: ten seconds of one station's messages.
DEPTH = 100


class Topics:
    """Publishers and subscriptions of a node. Users may override their quality of service.

    templates  names of topics with {type}, by way: received, transmitted, metadata.
    """

    def __init__(self, node: Any, templates: Mapping[str, str]) -> None:
        self._node = node
        self._templates = templates
        self._named: dict[str, str] = {}

    def name(self, way: str, handler: str, word: str) -> str:
        """Return the name of a handler's topic. word: replaces {type}.

        Raises GatewayError if another topic has the name, also by remapping: received messages would be sent again.
        """
        topic = self._templates[way].replace("{type}", word)
        what = f"{handler}: topics.{way}"
        with in_words(what):
            full_name = self._node.resolve_topic_name(topic)
        other = self._named.setdefault(full_name, what)
        if other != what:
            raise GatewayError(f"{other} and {what} are one topic, {full_name}: choose different names")
        return topic

    def publisher(self, type_: Any, topic: str) -> Any:
        """Create a publisher. Raises GatewayError if rclpy refuses it."""
        with in_words(topic):
            return self._node.create_publisher(type_, topic, _qos(), qos_overriding_options=_overridable())

    def subscription(self, type_: Any, topic: str, call: Callable[[Any], None], is_raw: bool = False) -> Any:
        """Create a subscription. Raises GatewayError if rclpy refuses it."""
        with in_words(topic):
            return self._node.create_subscription(
                type_, topic, call, _qos(), raw=is_raw, qos_overriding_options=_overridable()
            )


def _qos() -> QoSProfile:
    return QoSProfile(depth=DEPTH, reliability=ReliabilityPolicy.RELIABLE)


def _overridable() -> QoSOverridingOptions:
    return QoSOverridingOptions.with_default_policies()
