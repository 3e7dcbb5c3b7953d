"""Nodes that use the gateway's topics with another type or definition."""

from collections.abc import Iterable
from typing import Any, NamedTuple


class Peer(NamedTuple):
    """A publisher or subscriber of a topic, from discovery. hash: RIHS01 as text; empty if ROS has none (Humble)."""

    node: str
    type: str
    hash: str
    gid: bytes


def peer(info: Any) -> Peer:
    """Convert a TopicEndpointInfo of rclpy."""
    hash_ = getattr(info, "topic_type_hash", None)
    value = bytes(getattr(hash_, "value", b""))
    said = f"RIHS{hash_.version:02d}_{value.hex()}" if any(value) and hash_ is not None else ""
    return Peer(f"{info.node_namespace.rstrip('/')}/{info.node_name}", info.topic_type, said, bytes(info.endpoint_gid))


def strangers(topic: str, own: Iterable[Peer], others: Iterable[Peer]) -> list[str]:
    """Return a sentence for each peer with another type or another definition of it.

    own  the gateway's own ends of the topic; the first has the expected type and definition.
    """
    expected = next(iter(own), None)
    if expected is None:
        return []
    said = []
    for other in others:
        if other.type != expected.type:
            said.append(f"{topic}: {other.node} uses type {other.type} instead of {expected.type}: no message passes")
        elif other.hash and expected.hash and other.hash != expected.hash:
            said.append(
                f"{topic}: {other.node} has another definition of {expected.type}: {other.hash}, and not "
                f"{expected.hash}; build both from the same message package"
            )
    return said
