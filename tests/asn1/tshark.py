"""tshark as an oracle: it takes our octets apart, and what it reads has to be what was written.

Wireshark 4.0 dissects Release 1 only, 4.4 some of Release 2. A message goes to it in a GeoNetworking single hop broadcast with BTP-B; of its
answer the leaves are compared, in the order of the encoding: numbers, items and strings.
"""

import json
import re
import shutil
import subprocess
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final
from xml.etree import ElementTree

from asn1.model import types as t
from drivers.wire import btp
from firmware.lab.pcap import Pcap
from tests.asn1.ranges import numbers, unfold
from tests.asn1.reach import components

FRAMES = Path(__file__).parent.parent / "captures" / "frames.json"
HEADERS: Final = 54  # octets: Ethernet 14, GeoNetworking basic header 4, common header 8, single hop broadcast 28
PAYLOAD_LENGTH = slice(22, 24)  # of the common header: what follows the extended header
LONGEST: Final = 60_000  # octets of a message: a frame of a capture holds 65535
CONTROLS: Final = re.compile(r"[\x00-\x09\x0b-\x1f\ufffe\uffff]")
BOOLEANS: Final = {"False": "0", "True": "1"}  # as 4.4 shows them
IS_HERE = shutil.which("tshark") is not None
# By messageID and protocolVersion. Other editions it takes for these or leaves alone; its TISTPG is over another data
# dictionary than the one in the schema.
WIRESHARK_4_0: Final = {
    "cam-1.4.1": (2, 2),
    "cam-1.3.2": (2, 1),
    "denm-1.3.1": (1, 2),
    "denm-1.2.2": (1, 1),
    "spatem-2.1.1": (4, 2),
    "mapem-2.1.1": (5, 2),
    "ivim-2.1.1": (6, 2),
    "srem-2.1.1": (9, 2),
    "ssem-2.1.1": (10, 2),
    "rtcmem-2.1.1": (13, 2),
    "cpm-tr-2.1.1": (14, 1),
}
# Release 2 in place of Release 1 where both have one protocolVersion: CAM V2.1.1, DENM V2.1.1, a draft of VAM V2.2.1.
# It knows no EVCSN and no EV-RSR, IMZM only with protocolVersion 2, and reads a VAM of V2.1.1, which has other bits, wrong.
WIRESHARK_4_4: Final = {
    "cam-2.1.1": (2, 2),
    "cam-1.3.2": (2, 1),
    "denm-2.2.1": (1, 2),
    "denm-1.2.2": (1, 1),
    "spatem-2.1.1": (4, 2),
    "mapem-2.1.1": (5, 2),
    "ivim-2.1.1": (6, 2),
    "tistpgtransaction-1.1.1": (8, 1),
    "srem-2.1.1": (9, 2),
    "ssem-2.1.1": (10, 2),
    "rtcmem-2.1.1": (13, 2),
    "cpm-2.1.1": (14, 2),
    "cpm-tr-2.1.1": (14, 1),
    "vam-2.3.1": (16, 3),
}
# Additions of DENM V2.2.1, and of the data dictionary of VAM V2.3.1: 4.4 passes over them.
ADDED_SINCE_4_4: Final = frozenset({
    "linkedDenms", "eventEnd", "lanePositions", "occupiedLanes", "linkedIvims", "linkedMapems",
    "detectionZonesToSpecifiedEventPoint", "predictedPaths", "roadConfiguration", "preCrash",
    "deltaTimeMidRange",
})  # fmt: skip


def _protocols() -> str:
    command = ["tshark", "-G", "protocols"]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout if IS_HERE else ""


KNOWS_RELEASE_2: Final = "\tits.message.vam\t" in _protocols()
NAME: Final = "tshark 4.4" if KNOWS_RELEASE_2 else "tshark 4.0"
MESSAGES: Final = WIRESHARK_4_4 if KNOWS_RELEASE_2 else WIRESHARK_4_0
UNKNOWN: Final[frozenset[str]] = ADDED_SINCE_4_4 if KNOWS_RELEASE_2 else frozenset()


def edition(message: bytes) -> str | None:
    """The edition by which tshark reads a message, by its header; None: it knows no such message."""
    return next((name for name, header in MESSAGES.items() if header == (message[1], message[0])), None)


def leaves_read(path: Path, messages: Sequence[bytes], port: int) -> list[list[str] | None]:
    """What tshark reads in each message; None where it finds it malformed or knows no such message. path: for the capture."""
    capture = Pcap(path)
    for message in messages:
        capture.write(_frame(port, message), 0)
    capture.close()
    command = ["tshark", "-n", "-r", str(path), "-T", "pdml"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as tshark:
        return list(_packets(tshark))


def leaves_written(schema: t.Schema, type_: t.Type, value: Any) -> list[str | None]:
    """The same of a value of ours, without defaults that are not sent and additions that tshark does not know; None for a character string."""
    return list(_written(schema, type_, value))


def is_same(read: list[str] | None, written: list[str | None]) -> bool:
    """Characters are not compared: tshark escapes them in several ways. What follows them shows their number."""
    return (
        read is not None
        and len(read) == len(written)
        and all(b in (None, a) for a, b in zip(read, written, strict=True))
    )


def _packets(tshark: "subprocess.Popen[bytes]") -> Iterator[list[str] | None]:
    """Its XML is not well-formed where a string is not: octets that are no UTF-8, control characters."""
    assert tshark.stdout is not None
    parser: Any = ElementTree.XMLPullParser(["end"])
    for line in tshark.stdout:
        parser.feed(CONTROLS.sub("", line.decode(errors="replace")))
        for _, element in parser.read_events():
            if isinstance(element, ElementTree.Element) and element.tag == "packet":
                yield _leaves(element)
                element.clear()


def _frame(port: int, message: bytes) -> bytes:
    headers = bytearray.fromhex(json.loads(FRAMES.read_text())["frames"][0]["hex"])[:HEADERS]
    packet = btp.encode(btp.BtpB(port, 0), message)
    headers[PAYLOAD_LENGTH] = len(packet).to_bytes(2, "big")
    return bytes(headers) + packet


def _leaves(packet: ElementTree.Element) -> list[str] | None:
    its = [one for one in packet if one.get("name") == "its"]
    if len(its) != 1 or packet.find(".//*[@name='_ws.malformed']") is not None:
        return None
    return list(_shown(its[0]))


def _shown(field: ElementTree.Element) -> Iterator[str]:
    for one in field:
        name = one.get("name", "")
        if one.get("showname", "").endswith(": 0 items"):
            continue
        if name.startswith(("per.", "_ws.", "data.len")) or (name.endswith("_element") and not len(one)):
            continue
        # A complaint stands below the leaf that it is about, or where something unknown is passed over, which has no name.
        below = [inner for inner in one if not inner.get("name", "").startswith("_ws.")]
        if (below and not _is_named_bit(below[0])) or (len(one) and not name):
            yield from _shown(one)
        else:
            show = one.get("show", "").replace(":", "")
            yield BOOLEANS.get(show, show)


def _is_named_bit(field: ElementTree.Element) -> bool:
    """its.AccelerationControl.brakePedalEngaged, dsrc.LaneAttributes.Bike.isBikeFlyOverLane: the bits of a string stand below it, with its type in their names."""
    return field.get("name", "").count(".") > 1


def _written(schema: t.Schema, type_: t.Type, value: Any) -> Iterator[str | None]:
    base, constraints = unfold(schema, type_)
    match base:
        case t.Integer() if value < 0 and (numbers(constraints).low or 0) >= 0:
            yield str(value % (1 << 32))  # outside of an unsigned root: shown without its sign
        case t.Sequence():
            yield from _members(schema, base, value)
        case t.Choice() if value[0] in UNKNOWN:
            pass
        case t.Choice():
            chosen = next(one.type for one in components(base) if one.name == value[0])
            yield from _written(schema, chosen, value[1])
        case t.SequenceOf():
            for one in value:
                yield from _written(schema, base.element, one)
        case t.Enumerated():
            yield str(next(one.value for one in (*base.root, *base.additions) if one.name == value))
        case t.BitString():
            yield value[0].hex()
        case t.OctetString():
            yield value.hex()
        case t.Null():
            pass
        case t.CharacterString():
            yield None
        case t.Boolean():
            yield str(int(value))
        case _:
            yield str(value)


def _members(schema: t.Schema, type_: t.Sequence, value: dict[str, Any]) -> Iterator[str | None]:
    for addition in (*type_.root, *type_.tail, *type_.additions):
        for one in addition.components if isinstance(addition, t.Group) else (addition,):
            if (
                one.name not in value
                or one.name in UNKNOWN
                or (one.default is not None and value[one.name] == one.default)
            ):
                continue
            if isinstance(one.type, t.OpenType):
                rows = schema.modules[one.type.set_.module].sets[one.type.set_.name].rows
                row = next((row.type for row in rows if row.value == value[one.type.selector]), None)
                yield from _written(schema, row or t.OctetString(), value[one.name])
            else:
                yield from _written(schema, one.type, value[one.name])
