"""Who else is at the gateway's topics with something else: another type, or another definition of the same type."""

from collections.abc import Iterable
from typing import Any, NamedTuple


class Peer(NamedTuple):
    """An end of a topic, as discovery tells it. hash: RIHS01 in words; empty where this ROS does not say (Humble)."""

    node: str
    type: str
    hash: str
    gid: bytes


def peer(info: Any) -> Peer:
    """Of rclpy's TopicEndpointInfo."""
    hash_ = getattr(info, "topic_type_hash", None)
    value = bytes(getattr(hash_, "value", b""))
    said = f"RIHS{hash_.version:02d}_{value.hex()}" if any(value) and hash_ is not None else ""
    return Peer(f"{info.node_namespace.rstrip('/')}/{info.node_name}", info.topic_type, said, bytes(info.endpoint_gid))


def strangers(topic: str, own: Iterable[Peer], others: Iterable[Peer]) -> list[str]:
    """What is wrong with each of the others, in words.

    own  the gateway's own ends of the topic: of the type and definition that are expected.
    """
    expected = next(iter(own), None)
    if expected is None:
        return []
    said = []
    for other in others:
        if other.type != expected.type:
            said.append(f"{topic}: {other.node} has it as {other.type}, and not as {expected.type}: nothing passes")
        elif other.hash and expected.hash and other.hash != expected.hash:
            said.append(
                f"{topic}: {other.node} has another definition of {expected.type}: {other.hash}, and not "
                f"{expected.hash}; build both from the same message package"
            )
    return said
