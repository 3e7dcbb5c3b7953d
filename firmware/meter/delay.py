"""How long a message was under way, only as well as the clocks of both ends know it."""

from firmware.meter.event import Clock, Received, Sent
from firmware.report import NEAR_S
from pps.delay import Delay

# A stamp of what left is made of two clocks that were read one after the other.
READING_NS = round(NEAR_S * 1e9)


def link(sent: Sent, received: Received) -> Delay | None:
    """From leaving one station to arriving at the other; None where clocks do not tell.

    It left between being handed to the driver and the driver's word that it had: half of that is part of what is not
    known.
    """
    return _between(sent.handed_ns, sent.handed_ns + sent.send_ns, sent.clock, received)


def one_way(sent: Sent, received: Received) -> Delay | None:
    """From being accepted by one station to arriving at the other."""
    return _between(sent.accepted_ns, sent.accepted_ns, sent.clock, received)


def _between(earliest_ns: int, latest_ns: int, clock: Clock, received: Received) -> Delay | None:
    doubt = between_clocks(clock, received.clock)
    if doubt is None:
        return None
    half_ns = (latest_ns - earliest_ns + 1) // 2
    return Delay(received.received_ns - earliest_ns - half_ns + doubt.ns, doubt.uncertainty_ns + half_ns)


def between_clocks(sender: Clock, receiver: Clock) -> Delay | None:
    """What has to be added to the difference of two stamps, and how well that is known; None where nobody knows it.

    Bounds are added: pps.delay.one_way says why.
    """
    if sender.boot and sender.boot == receiver.boot:
        return Delay(0, READING_NS)
    if sender.offset_ns is None or receiver.offset_ns is None:
        return None
    if sender.uncertainty_ns is None or receiver.uncertainty_ns is None:
        return None
    return Delay(receiver.offset_ns - sender.offset_ns, sender.uncertainty_ns + receiver.uncertainty_ns + READING_NS)
