"""Router under test, with scripted interfaces."""

from board.runtime.describe import read
from drivers.contract import Can
from drivers.message import Confirm, Ego, Outcome, Position
from drivers.reason import Reason
from firmware.config.tables import Tables
from firmware.routing.drops import Drops
from firmware.routing.interface import Interface
from firmware.routing.options import NOTHING_ASKED, Parsed
from firmware.routing.policy import Policy
from firmware.routing.router import Router
from firmware.topics import Topics
from tests.firmware.doubles import BOTH_WAYS, CAM_PDU, ScriptedDriver, interface_of
from tests.virtual import VirtualLoop


class Bench:
    """A router with interfaces that are up."""

    def __init__(self, loop: VirtualLoop, names: str = "g5 mqtt", profile: str = "standard") -> None:
        self.loop = loop
        self.topics = Topics(profile)
        self.drops = Drops()
        self.router = Router(loop, self.topics, self.drops, lambda: Ego(0, Position(), False), lambda: 0)
        self.router.set_listeners([], [self])
        self.confirms: list[tuple[Confirm, list[str]]] = []
        self.drivers: dict[str, ScriptedDriver] = {}
        for name in names.split():
            self.add(name)

    def add(self, name: str, can: Can = BOTH_WAYS, broker: str = "") -> Interface:
        driver = self.drivers[name] = ScriptedDriver(can, broker)
        interface = interface_of(self.loop, self.router, driver, name, self.topics, self.drops)
        self.router.add(interface)
        return interface

    def confirm(self, confirm: Confirm, targets: tuple[Interface, ...]) -> None:
        self.confirms.append((confirm, [interface.name for interface in targets]))

    def policy(self, *rows: dict[str, object]) -> None:
        table = read(Tables, {"policy": list(rows)}, "test")
        self.router.set_policy(Policy(table.policy, self.topics, self.router))

    def request(self, number: int = 2, pdu: bytes = CAM_PDU, asked: Parsed = NOTHING_ASKED) -> None:
        self.router.request(self.topics.by_number[number], pdu, "from_users", asked)

    def link(self, name: str, is_up: bool) -> None:
        self.router.interfaces[name].link(is_up, "as the test says")

    def sent_by(self, name: str) -> list[int]:
        return [request.number for request in self.drivers[name].sent]

    def refusals(self) -> list[Reason | None]:
        return [confirm.reason for confirm, _ in self.confirms if confirm.outcome is Outcome.REFUSED]

    @property
    def refused(self) -> int:
        return sum(drop["count"] for drop in self.drops.status() if drop["where"] == "from_users")
