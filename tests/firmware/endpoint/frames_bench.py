"""Station that shows its messages to the frames under test."""

import json
from collections.abc import Iterator
from contextlib import closing
from types import SimpleNamespace
from typing import Any

import pytest

from board.time.scales import Lock, TimeQuality
from drivers.contract import NOW, Witness
from drivers.message import (
    NO_RX_INFO,
    Confirm,
    Ego,
    Indication,
    Outcome,
    Request,
    RxInfo,
)
from drivers.packet.geolink import GeoLink
from firmware.endpoint import frames
from firmware.endpoint.frames import LATER_S, Frames
from firmware.routing.drops import Drops
from firmware.topics import Topics
from tests.drivers.host import SHARED, Host
from tests.firmware.doubles import CAM_PDU, INGOLSTADT, request_of
from tests.reference.topics import undocumented
from tests.virtual import VirtualLoop

MAC, PEER = bytes.fromhex("02000000000b"), bytes.fromhex("02000000000c")
NOW_NS = 1_795_182_426_461_613_000
EGO = Ego(722_130_000_000, INGOLSTADT, True)
QUALITY = TimeQuality(Lock.LOCKED, 10, 50)
TOPICS = Topics()
# EN 302 636-4-1 clause 9.8.6, of a station at Ingolstadt.
BEACON = bytes.fromhex(
    "ffffffffffff02000000000c894711001a010010008000000100000002000000000c0000000a1d1139d806d06ee880000000"
)


class Counts:
    """Counters of an interface."""

    def __init__(self) -> None:
        self.received = [0]
        self.sent_count = [0]


class Bench:
    """A station that shows all it has to the frames, for as long as they attend."""

    def __init__(self, loop: VirtualLoop) -> None:
        self.loop = loop
        self.interfaces = {"air": Counts(), "wire": Counts()}
        self.requests = self.accepted = 0
        self.burst: list[bytes] = []  # what has come and has not gone up yet
        self.told: list[tuple[bytes, dict[str, Any], bytes]] = []
        self.drops = Drops()
        self.witness = Witness()
        self.frames = Frames(loop, self.publish, self, MAC, self.drops, self.attend)
        self.drops.listener = self.frames
        self.attend(True)

    def attend(self, is_wanted: bool) -> None:
        self.is_shown = is_wanted
        self.witness.watch = self.frames if is_wanted else None

    def flush(self) -> None:
        burst, self.burst = self.burst, []
        for pdu in burst:
            self.indicate(pdu)

    def confirm(self, confirm: Confirm) -> None:
        if confirm.outcome is Outcome.REFUSED:
            self.requests += 1
        elif confirm.outcome is Outcome.SENT:
            self.interfaces[confirm.interface].sent_count[0] += 1
        if self.is_shown:
            self.frames.confirm(confirm)

    def ego(self) -> Ego:
        return EGO

    def quality_now(self) -> TimeQuality:
        return QUALITY

    def publish(self, topic: bytes, body: bytes, octets: bytes) -> None:
        said = json.loads(body)
        assert undocumented("frame", said) == []
        self.told.append((topic, said, octets))

    def indicate(self, pdu: bytes, interface: str = "air", rx: RxInfo = NO_RX_INFO, when_ns: int = NOW_NS) -> None:
        kind = TOPICS.by_number[pdu[1]]
        self.interfaces[interface].received[0] += 1
        if not self.is_shown:
            return
        self.frames.observe([Indication(kind, pdu, interface, when_ns, 0.0, rx, QUALITY)])

    def later(self) -> list[dict[str, Any]]:
        """Return what was reported since the last call."""
        self.loop.run_for(LATER_S * 1.5)
        told, self.told = self.told, []
        self.octets = [octets for _, _, octets in told]
        return [said for _, said, _ in told]


@pytest.fixture(autouse=True, scope="module")
def unix_time() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(frames, "time", SimpleNamespace(time_ns=lambda: NOW_NS))
        yield


@pytest.fixture
def bench() -> Iterator[Bench]:
    with closing(VirtualLoop()) as loop:
        yield Bench(loop)


def gn_frame(pdu: bytes = CAM_PDU, request: Request | None = None) -> bytes:
    with closing(VirtualLoop()) as loop:
        return GeoLink(Host(loop), SHARED, PEER, 0.0, lambda _: None).encode(request or request_of(pdu=pdu))


def linked(bench: Bench) -> tuple[GeoLink, Host]:
    """A link whose station is the bench: its host indicates and drops there."""
    host = Host(bench.loop)
    host.name = "air"
    host.indicate = lambda pdu, received_ns, rx=NO_RX_INFO: bench.indicate(pdu, rx=rx, when_ns=received_ns)
    host.drop = lambda reason, sample=b"", count=1, detail="": bench.drops.count("air", reason, sample, count, detail)
    return GeoLink(host, SHARED._replace(witness=bench.witness), MAC, 3.0, lambda octets: NOW), host
