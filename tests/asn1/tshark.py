"""tshark as an oracle: it takes our octets apart, and what it reads has to be what was written.

It dissects Release 1 only (Wireshark 4.0). A message goes to it in a GeoNetworking single hop broadcast with BTP-B; of its
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

from asn1 import types as t
from drivers.wire import btp
from firmware.lab.pcap import Pcap
from tests.asn1.ranges import numbers, unfold
from tests.asn1.reach import components

FRAMES = Path(__file__).parent.parent / "captures" / "frames.json"
HEADERS: Final = 54  # octets: Ethernet 14, GeoNetworking basic header 4, common header 8, single hop broadcast 28
PAYLOAD_LENGTH = slice(22, 24)  # of the common header: what follows the extended header
LONGEST: Final = 60_000  # octets of a message: a frame of a capture holds 65535
CONTROLS: Final = re.compile(r"[\x00-\x09\x0b-\x1f\ufffe\uffff]")
IS_HERE = shutil.which("tshark") is not None
# What Wireshark 4.0 knows, by messageID and protocolVersion. Other editions it takes for these or
# leaves alone; its TISTPG is over another data dictionary than the one in the schema.
MESSAGES: Final = {
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
    """The same of a value of ours, defaults that are not sent left out; None for a character string."""
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
        if len(one) and not _is_named_bit(one[0]):
            yield from _shown(one)
        else:
            yield one.get("show", "").replace(":", "")


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
            if one.name not in value or (one.default is not None and value[one.name] == one.default):
                continue
            if isinstance(one.type, t.OpenType):
                rows = schema.modules[one.type.set_.module].sets[one.type.set_.name].rows
                row = next((row.type for row in rows if row.value == value[one.type.selector]), None)
                yield from _written(schema, row or t.OctetString(), value[one.name])
            else:
                yield from _written(schema, one.type, value[one.name])
