"""Delay of a message, with the accuracy of both clocks."""

from firmware.endpoint.report import NEAR_S
from firmware.meter.event import Clock, ReceivedEvent, Sent
from pps.delay import Delay

# Time stamps of a sent message combine two clocks that are read one after the other; this is their uncertainty.
READING_NS = round(NEAR_S * 1e9)


def link(sent: Sent, received: ReceivedEvent) -> Delay | None:
    """Return the delay from leaving one station to arriving at the other; None if the clocks' accuracy is unknown.

    The message left at some time between its transfer to the driver and the driver's confirmation. Half of that
    interval is added to the uncertainty.
    """
    return _between(sent.handed_ns, sent.handed_ns + sent.send_ns, sent.clock, received)


def one_way(sent: Sent, received: ReceivedEvent) -> Delay | None:
    """Return the delay from acceptance by one station to arrival at the other.

    Returns None if the clocks' accuracy is unknown.
    """
    return _between(sent.accepted_ns, sent.accepted_ns, sent.clock, received)


def _between(earliest_ns: int, latest_ns: int, clock: Clock, received: ReceivedEvent) -> Delay | None:
    doubt = between_clocks(clock, received.clock)
    if doubt is None:
        return None
    half_ns = (latest_ns - earliest_ns + 1) // 2
    return Delay(received.received_ns - earliest_ns - half_ns + doubt.ns, doubt.uncertainty_ns + half_ns)


def between_clocks(sender: Clock, receiver: Clock) -> Delay | None:
    """Return the correction for the difference of two stamps, and its uncertainty; None if it is unknown.

    Uncertainties are added, not combined as squares: see pps.delay.one_way.
    """
    if sender.boot and sender.boot == receiver.boot:
        return Delay(0, READING_NS)
    if sender.offset_ns is None or receiver.offset_ns is None:
        return None
    if sender.uncertainty_ns is None or receiver.uncertainty_ns is None:
        return None
    return Delay(receiver.offset_ns - sender.offset_ns, sender.uncertainty_ns + receiver.uncertainty_ns + READING_NS)
