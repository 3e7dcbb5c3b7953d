"""Message types: messageID, name in the envelope, BTP port, priority, lifetime and traffic class."""

import re
from collections.abc import Iterable
from typing import NamedTuple

from drivers.message import MessageType


class TypeRow(NamedTuple):
    """Row of the table of message types.

    number         messageID of the ITS PDU header (TS 102 894-2 v2.4.1, DE MessageId).
    name           name in the envelope.
    standard       BTP port in profile `standard`, by TS 103 248; None: the type is not sent.
    legacy         BTP port in profile `legacy`, which sends as older boxes do. Both profiles receive at both ports.
    priority       priority in the queue: 0 leaves first.
    lifetime       longest time in a queue in seconds, and the lifetime in the header of a single-hop broadcast.
    traffic_class  octet of the GeoNetworking common header; its TC ID is the DCC profile.
    """

    number: int
    name: str
    standard: int | None
    legacy: int | None
    priority: int = 3
    lifetime: float = 1.0
    traffic_class: int = 2


# BTP ports are those of ETSI TS 103 248 v2.3.1, table 1. The legacy ports and the messageIDs 14 and 102 are those of
# existing vehicleCAPTAIN boxes. Priorities: DENM before messages of the infrastructure before CAM, CPM and VAM.
# Traffic classes are the DCC profiles of TS 102 724 V1.1.1. DP0 is for a DENM of high priority, which the user sets.
# DP1 is for other DENMs, DP2 for CAM and equally frequent messages, DP3 for messages that can wait. ITS-G5 sends them
# by AC_VO, AC_VI, AC_BE and AC_BK. The lifetime of a CAM is at most 1 s by EN 302 637-2 V1.4.1 clause 5.3.4.1. The
# other lifetimes are our choice: 1 s for messages that are as frequent as CAMs, 10 s for events, 5 s for slow changes.
# All are below the default of 60 s (itsGnDefaultPacketLifetime, EN 302 636-4-1 V1.4.1 Annex H).
ROWS = (
    TypeRow(1, "denm", 2002, 2002, priority=0, lifetime=10.0, traffic_class=1),
    TypeRow(2, "cam", 2001, 2001, priority=2),
    TypeRow(3, "poi", 2010, 2010, lifetime=5.0, traffic_class=3),
    TypeRow(4, "spatem", 2004, 2004, priority=1),
    TypeRow(5, "mapem", 2003, 2003, priority=1, lifetime=5.0),
    TypeRow(6, "ivim", 2006, 2006, priority=1, lifetime=5.0),
    TypeRow(7, "ev_rsr", 2012, 2012, lifetime=5.0, traffic_class=3),
    TypeRow(8, "tistpgtransaction", 2011, None, lifetime=5.0, traffic_class=3),
    TypeRow(9, "srem", 2007, 2007, priority=1),
    TypeRow(10, "ssem", 2008, 2008, priority=1),
    TypeRow(11, "evcsn", 2010, 2010, lifetime=5.0, traffic_class=3),
    TypeRow(12, "saem", 2005, 2005, lifetime=5.0, traffic_class=3),
    TypeRow(13, "rtcmem", 2013, 2013),
    TypeRow(14, "cpm", 2009, 2001, priority=2),
    TypeRow(15, "imzm", 2019, None, lifetime=5.0, traffic_class=3),
    TypeRow(16, "vam", 2018, 2001, priority=2),
    TypeRow(20, "mcm", 2017, None, priority=2),
    TypeRow(102, "vam", 2018, 2001, priority=2),
)
NAMELESS_IN_LEGACY = frozenset({15, 20})
LEGACY_VAM = 102

# Forms of messages in JSON: as `captain decode --json` prints them, and with SI units.
JSON_FORMS = EXACT, PLAIN = ("json", "plain")
# Largest number of reception queues of an interface. Each is a socket, and the kernel lets 256 sockets share the frames
# of a device.
MAX_LANES = 63


def type_name(message_type: str) -> str:
    """Return the name in envelopes of a type of the message library; `.` and `-` are not allowed there."""
    return re.sub(r"[.-]", "_", message_type)


class Topics:
    """Table of message types of a profile, with lookups by messageID and envelope.

    profile  "standard" or "legacy".
    extra    rows of the user, which replace rows with the same messageID.
    """

    def __init__(self, profile: str = "standard", extra: Iterable[TypeRow] = ()) -> None:
        is_legacy = profile == "legacy"
        own = tuple(extra)
        taken = {row.number for row in own}
        rows = [*own, *(row for row in ROWS if row.number not in taken)]
        self._is_legacy = is_legacy
        self.unknown = MessageType("", -1, None, 7, len(rows))
        self.by_number: list[MessageType] = [self.unknown] * 256
        self.by_envelope: dict[bytes, MessageType] = {}
        self.kinds: list[MessageType] = []
        self.ports: set[int] = set()
        for index, row in enumerate(rows):
            is_nameless = is_legacy and row.number in NAMELESS_IN_LEGACY and row.number not in taken
            port = row.legacy if is_legacy else row.standard
            name = "" if is_nameless else row.name
            kind = MessageType(name, row.number, port, row.priority, index, row.lifetime, row.traffic_class)
            self._enter(kind, row)
        self.kinds.append(self.unknown)
        self.envelopes = [b"v2x.%s." % kind.name.encode() for kind in self.kinds]

    def add(self, row: TypeRow) -> MessageType | None:
        """Add a type while the station runs. Return None if its messageID or its name is taken."""
        if self.by_number[row.number] is not self.unknown or any(kind.name == row.name for kind in self.kinds):
            return None
        port = row.legacy if self._is_legacy else row.standard
        index = len(self.kinds)
        kind = MessageType(row.name, row.number, port, row.priority, index, row.lifetime, row.traffic_class)
        self._enter(kind, row)
        self.envelopes.append(b"v2x.%s." % kind.name.encode())
        return kind

    def has(self, row: TypeRow) -> bool:
        """Return True if the table has this row."""
        kind = self.by_number[row.number]
        port = row.legacy if self._is_legacy else row.standard
        return kind == MessageType(row.name, row.number, port, row.priority, kind.row, row.lifetime, row.traffic_class)

    def _enter(self, kind: MessageType, row: TypeRow) -> None:
        self.kinds.append(kind)
        self.by_number[row.number] = kind
        self.ports.update(port for port in (row.standard, row.legacy) if port is not None)
        if kind.name and self._speaks_for_its_name(kind, self._is_legacy):
            self.by_envelope[b"v2x.%s." % kind.name.encode()] = kind

    def _speaks_for_its_name(self, kind: MessageType, is_legacy: bool) -> bool:
        """Return True if the type is the one that its envelope means.

        Two messageIDs have the name vam: `v2x.vam.` means the one that the profile sends.
        """
        if kind.name != "vam" or kind.number not in (16, LEGACY_VAM):
            return True
        return (kind.number == LEGACY_VAM) is is_legacy

    def of_each_type(self, *words: str) -> tuple[bytes, ...]:
        """Return topics of port 5558 for each type, such as b"json.cam."; b"json.." is for messages without a name."""
        names = dict.fromkeys(kind.name for kind in self.kinds)
        return tuple(f"{word}.{name}.".encode() for word in words for name in names)

    def names(self) -> list[str]:
        """Return the names of all types, without duplicates."""
        return list(dict.fromkeys(kind.name for kind in self.kinds if kind.name))

    def lanes(self) -> tuple[frozenset[int], ...]:
        """Return the messageIDs of each reception queue: first all of priority 0, then those of each name by priority.

        Types beyond MAX_LANES are left out: they share the queue of unknown types.
        """
        urgent: set[int] = set()
        others: dict[str, set[int]] = {}
        for kind in sorted((kind for kind in self.kinds if kind is not self.unknown), key=lambda kind: kind.priority):
            lane = urgent if kind.priority == 0 else others.setdefault(kind.name or str(kind.number), set())
            lane.add(kind.number)
        return tuple(map(frozenset, (urgent, *others.values())))[:MAX_LANES]
