"""The radio's queue that a message leaves by: the traffic class of ITS as what mac80211 chooses a queue by."""

import socket

# User priority (IEEE 802.1D) by TC-ID, the low six bits of the traffic class: TS 102 636-4-2 gives 0 AC_VO, 1 AC_VI,
# 2 AC_BE and 3 AC_BK, and mac80211 (ieee802_1d_to_ac) those queues to these priorities. Other TC-IDs are reserved.
USER_PRIORITY = {0: 7, 1: 5, 2: 0, 3: 1}
TC_ID = 0x3F

# What a new socket sends with: best effort.
NEW_SOCKET = 2
# Of beacons: itsGnDefaultTrafficClass (EN 302 636-4-1 V1.4.1, Annex H).
BEACON = 0

# cfg80211_classify8021d() takes a socket's priority for a user priority from this offset on.
OFFSET = 256

NOT_PERMITTED = "traffic classes do not reach the radio: the kernel wants CAP_NET_ADMIN for that"


def user_priority(traffic_class: int) -> int:
    """802.1D user priority 0..7 of a traffic class: the octet of EN 302 636-4-1 V1.4.1 clause 9.7.5."""
    return USER_PRIORITY.get(traffic_class & TC_ID, 0)


def prioritize_frames(sender: socket.socket, traffic_class: int) -> str:
    """Set what a raw socket's next frames leave by; returns what to tell the user where that is not permitted."""
    try:
        sender.setsockopt(socket.SOL_SOCKET, socket.SO_PRIORITY, OFFSET + user_priority(traffic_class))
    except PermissionError:
        return NOT_PERMITTED
    return ""


def prioritize_datagrams(sender: socket.socket, traffic_class: int) -> None:
    """Set what a UDP socket's next datagrams leave by: its class selector (RFC 2474) is the user priority.

    Other than a socket's priority, it needs no privilege and is still there when a gateway has the radio.
    """
    sender.setsockopt(socket.IPPROTO_IP, socket.IP_TOS, user_priority(traffic_class) << 5)
