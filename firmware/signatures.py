"""Signed messages that are delivered unverified: log line, and words for status and doctor."""

import logging

log = logging.getLogger("captain.security")

UNVERIFIED = "signatures are not verified yet"
DELIVERED = "signed messages are delivered as unverifiable-pkt"
BY_POLICY = {"deliver": DELIVERED, "drop": "signed messages are dropped"}


class Signatures:
    """Counts messages that interfaces deliver as unverifiable, and logs the first.

    policy  reception.unverified of captain.toml.
    """

    def __init__(self, policy: str) -> None:
        self._policy = policy
        self._delivered = 0

    def deliver(self) -> None:
        """Count one message."""
        self._delivered += 1
        if self._delivered == 1:
            log.warning(
                '%s: %s; to drop them, set reception.unverified = "drop" in captain.toml', UNVERIFIED, DELIVERED
            )

    def status(self) -> dict[str, object]:
        """The object `security` of the status."""
        return {"verifies": False, "unverified": self._policy, "delivered": self._delivered}
