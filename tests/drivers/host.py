"""Host of a driver under test: answers like a station and records calls."""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping

from board.runtime.errors import StationError
from board.runtime.loop import Loop
from board.time.scales import Fix, TimeMark
from drivers.contract import Shared
from drivers.message import NO_RX_INFO, Area, Ego, MessageType, Position, Request, RxInfo
from drivers.reason import Reason
from tests.virtual import VirtualLoop

MAC = bytes.fromhex("02000000000c")
SHARED = Shared(mac=MAC, btp_ports=frozenset({2001, 2002}))
EGO = Ego(its_ms=722_130_000_000, position=Position(487_668_616, 114_320_680), is_known=True)
CAM = bytes.fromhex("0202000005390001020304")
DENM = bytes.fromhex("0201000005390001020304")
TYPES = {2: MessageType("cam", 2, 2001, 4, 0), 1: MessageType("denm", 1, 2002, 0, 1)}


class Host:
    """Implementation of drivers.contract.Host that records all calls in lists."""

    def __init__(self, loop: Loop, keeps: bool = True) -> None:
        self.name = "bench"
        self.slot = ""
        self.loop = loop
        self.keeps = keeps  # False where a hundred thousand are only counted
        self.count = 0
        self.indications: list[tuple[bytes, int, RxInfo]] = []
        self.requests: list[tuple[bytes, int | None]] = []
        self.neighbours: list[bytes] = []
        self.drops: Counter[Reason] = Counter()
        self.samples: list[bytes] = []
        self.drop_details: list[str] = []
        self.confirms: list[tuple[Request, Reason | None]] = []
        self.confirm_details: list[str] = []
        self.links: list[tuple[bool, str]] = []
        self.bring_up: list[str] = []  # those of links that are steps of it
        self.failures: list[StationError] = []
        self.fixes: list[Fix] = []
        self.time_marks: list[TimeMark] = []
        self.details: list[Mapping[str, object]] = []
        self.times_writable = 0
        self.on_indication: Callable[[], None] = lambda: None

    @property
    def pdus(self) -> list[bytes]:
        return [pdu for pdu, _, _ in self.indications]

    @property
    def is_up(self) -> bool:
        return bool(self.links) and self.links[-1][0]

    @property
    def total(self) -> int:
        """Return the number of received messages, indicated or dropped."""
        return self.count + len(self.neighbours) + self.drops.total()

    def indicate(self, pdu: bytes, received_ns: int, rx: RxInfo = NO_RX_INFO) -> None:
        self.count += 1
        if self.keeps:
            self.indications.append((pdu, received_ns, rx))
        self.on_indication()

    def request(self, pdu: bytes, btp_port: int | None = None) -> None:
        self.requests.append((pdu, btp_port))

    def heard(self, mac: bytes, rssi_dbm: int | None) -> None:
        self.neighbours.append(mac)

    def drop(self, reason: Reason, sample: bytes = b"", count: int = 1, detail: str = "") -> None:
        self.drops[reason] += count
        if self.keeps:
            self.samples.append(sample)
            self.drop_details.append(detail)

    def confirm(self, request: Request, reason: Reason | None = None, detail: str = "") -> None:
        self.confirms.append((request, reason))
        self.confirm_details.append(detail)

    def writable(self) -> None:
        self.times_writable += 1

    def link(self, is_up: bool, why: str) -> None:
        self.links.append((is_up, why))

    def starting(self, why: str) -> None:
        self.links.append((False, why))
        self.bring_up.append(why)

    def fail(self, error: StationError) -> None:
        self.failures.append(error)

    def ego(self) -> Ego:
        return EGO

    def its_ms(self) -> int:
        return EGO.its_ms

    def fix(self, fix: Fix) -> None:
        self.fixes.append(fix)

    def time_mark(self, mark: TimeMark) -> None:
        self.time_marks.append(mark)

    def report_details(self, details: Mapping[str, object]) -> None:
        self.details.append(details)


def told(loop: VirtualLoop, is_done: Callable[[], bool], patience_s: float = 2.0) -> None:
    """Run the loop until the kernel has reported an event. Its threads get more real time than usual."""
    usual, loop.patience_s = loop.patience_s, patience_s
    loop.run_until(is_done)
    loop.patience_s = usual


def request(pdu: bytes, number: int = 1, area: Area | None = None) -> Request:
    """Return a request as the router creates it for a CAM or a DENM. Other PDUs are treated as a CAM."""
    kind = TYPES.get(pdu[1], TYPES[2])
    assert kind.btp_port is not None
    return Request(number, kind, pdu, kind.btp_port, 0.0, 1e9, kind.priority, 2, area)


def requests(pdus: Iterable[bytes]) -> list[Request]:
    return [request(pdu, number) for number, pdu in enumerate(pdus, 1)]
