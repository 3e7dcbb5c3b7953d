"""Events of a connection to a broker, which Network reports to its user: a Session, a tap or the doctor."""

from typing import Protocol

from drivers.mqtt.client.window import Accepted
from drivers.reason import Reason
from drivers.wire.v2n.message import Delivery


class NetworkEvents(Protocol):
    """Events that a Network reports in its turn(). `now` is the time of the turn, by the monotonic clock."""

    def connected(self, accepted: Accepted, now: float) -> None:
        """Take note that the broker has accepted the connection."""

    def failed(self, why: str, now: float, is_away: bool = False) -> None:
        """Take note that a try to connect has failed.

        why      reason in words.
        is_away  this machine has no network, so the try did not reach the broker.
        """

    def lost(self, why: str, now: float, is_cut: bool = False, code: int = 0) -> None:
        """Take note that an accepted connection has ended.

        why     reason in words.
        is_cut  the network has cut the connection, not the broker.
        code    reason code of the broker's DISCONNECT (MQTT 5.0, clause 3.14.2.1); 0 without one.
        """

    def subscribed(self, refused: dict[str, str], now: float) -> None:
        """Take note of the broker's answer to subscribe().

        refused  filters that the broker refuses, with its reasons in words.
        """

    def unsubscribed(self, now: float) -> None:
        """Take note of the broker's answer to unsubscribe()."""

    def published(self, token: int, why: str, now: float) -> None:
        """Take note that a publication was written (QoS 0), acknowledged or refused.

        token  number that publish() returned.
        why    the broker's reason of a refusal; otherwise empty.
        """

    def writable(self, now: float) -> None:
        """Take note that the network accepts publications again."""

    def received(self, delivery: Delivery, now: float) -> None:
        """Take a message that the broker delivered."""

    def drop(self, reason: Reason, sample: bytes, count: int = 1, why: str = "") -> None:
        """Take note of a discarded message; why: explanation in words."""
