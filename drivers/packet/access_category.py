"""Access categories: sets the socket's priority from the traffic class.

The Linux stack for 802.11, mac80211, chooses one of the radio's four transmit queues by this priority.
"""

import socket

# User priority (IEEE 802.1D) by TC-ID, the low six bits of the traffic class. TS 102 636-4-2 assigns access categories:
# 0 AC_VO, 1 AC_VI, 2 AC_BE, 3 AC_BK. In mac80211 (ieee802_1d_to_ac) these user priorities select the same categories.
# Other TC-IDs are reserved.
USER_PRIORITY = {0: 7, 1: 5, 2: 0, 3: 1}
TC_ID = 0x3F

# Traffic class of a new socket: best effort.
NEW_SOCKET = 2
# Traffic class of beacons: itsGnDefaultTrafficClass (EN 302 636-4-1 V1.4.1, Annex H).
BEACON = 0

# Socket priorities from this number on mean a user priority plus this offset (kernel: cfg80211_classify8021d()).
OFFSET = 256

NOT_PERMITTED = "traffic classes do not reach the radio: the kernel wants CAP_NET_ADMIN for that"


def user_priority(traffic_class: int) -> int:
    """Return the 802.1D user priority, 0..7, of a traffic class: the octet of EN 302 636-4-1 V1.4.1 clause 9.7.5."""
    return USER_PRIORITY.get(traffic_class & TC_ID, 0)


def prioritize_frames(sender: socket.socket, traffic_class: int) -> str:
    """Set the priority of a raw socket's next frames; return a note for the user if it is not permitted, else ""."""
    try:
        sender.setsockopt(socket.SOL_SOCKET, socket.SO_PRIORITY, OFFSET + user_priority(traffic_class))
    except PermissionError:
        return NOT_PERMITTED
    return ""


def prioritize_datagrams(sender: socket.socket, traffic_class: int) -> None:
    """Set the priority of a UDP socket's next datagrams: their class selector (RFC 2474) becomes the user priority.

    Unlike a socket's priority, the class selector needs no privilege. It is part of the datagram, so it also works if
    the radio belongs to a gateway.
    """
    sender.setsockopt(socket.IPPROTO_IP, socket.IP_TOS, user_priority(traffic_class) << 5)
