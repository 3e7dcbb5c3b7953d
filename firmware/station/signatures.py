"""Signed messages without verification: log line, and texts for status and doctor."""

import logging

log = logging.getLogger("captain.security")

UNVERIFIED = "signatures are not verified yet"
DELIVERED = "signed messages are delivered as unverifiable-pkt"
BY_POLICY = {"deliver": DELIVERED, "drop": "signed messages are dropped"}


class Signatures:
    """Counter of signed messages that are delivered without verification; it logs the first.

    policy  reception.unverified of captain.toml.
    """

    def __init__(self, policy: str) -> None:
        self._policy = policy
        self._delivered = 0

    def deliver(self) -> None:
        """Count one delivered message."""
        self._delivered += 1
        if self._delivered == 1:
            log.warning(
                '%s: %s; to drop them, set reception.unverified = "drop" in captain.toml', UNVERIFIED, DELIVERED
            )

    def status(self) -> dict[str, object]:
        """Return the object `security` of the status.

        verifies    always false, because the station does not verify signatures yet.
        unverified  value of `reception.unverified`.
        delivered   number of signed messages that were delivered without verification.
        """
        return {"verifies": False, "unverified": self._policy, "delivered": self._delivered}
