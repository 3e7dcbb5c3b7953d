"""Bench of a modem interface: simulated modem and a minimal supervisor."""

from collections.abc import Callable
from pathlib import Path

from board.runtime.errors import InterfaceError, StationError, StuckError
from drivers.sim.machine import SimulatedMachine
from drivers.sim.modem.modem import SimulatedModem
from drivers.sim8202g.driver import Sim8202g
from drivers.sim8202g.options import ModemOptions
from drivers.sim8202g.script import Ended, Program, Run, StepError
from drivers.sim8202g.system import Counters, Route, System
from tests.drivers.host import SHARED, Host

PLACE = "1-1.2"
RETRY_S = 5.0


class NoProgram:
    """Program that has already ended."""

    def stop(self) -> None: ...


class FakeSystem(System):
    """Fake of the machine's tools. A table has the output for the beginning of each command line.

    ran       command lines that were run.
    has       addresses of every device.
    fails     beginnings of command lines that end with status 1; a program that is to keep running ends at once.
    counts    numbers of received and sent packets.
    routes    default routes of every device.
    """

    def __init__(self, machine) -> None:
        super().__init__(machine)
        self.ran: list[str] = []
        self.printed: dict[str, str] = {}
        self.has: tuple[str, ...] = ("192.168.225.34",)
        self.fails: set[str] = set()
        self.counts: Counters | None = None
        self.routes: list[Route] = []
        self.keeps = False
        self.kept_ended: Callable[[], None] = lambda: None

    @property
    def is_keeping(self) -> bool:
        return self.keeps

    def run(self, loop, run: Run, done, ended) -> Program:
        line = " ".join(run.argv)
        self.ran.append(line)
        if "addr show" in line:
            loop.soon(lambda: done(Ended(0, "".join(f"3: x    inet {one}/30 scope global x\n" for one in self.has))))
            return NoProgram()
        printed = next((text for begin, text in self.printed.items() if begin in line), "")
        status = 1 if any(begin in line for begin in self.fails) else 0
        if run.keep and not status:
            self.keeps, self.kept_ended = True, ended
            loop.after(0.1, lambda: done(Ended(None, printed)))
        elif run.keep:
            loop.after(
                0.1,
                lambda: done(
                    StepError(f"{run.argv[0]} ended with status {status} before the network had assigned an address")
                ),
            )
        else:
            loop.after(0.1, lambda: done(Ended(status, printed)))
        return NoProgram()

    def stop_kept(self) -> None:
        self.keeps = False

    def default_routes(self, device: str) -> list[Route]:
        return self.routes

    def counters(self, device: str) -> Counters | None:
        return self.counts


class Station(Host):
    """Host that restarts its driver after a failure.

    power_cycle  called after a StuckError.
    """

    def __init__(self, loop, driver: Sim8202g) -> None:
        super().__init__(loop)
        self.driver = driver
        self.refused: list[StationError] = []
        self.is_running = False
        self.power_cycle: Callable[[], None] = lambda: None

    def begin(self) -> None:
        try:
            self.driver.start(self)
        except InterfaceError as error:
            self.refused.append(error)
            self.loop.after(RETRY_S, self.begin)
        else:
            self.is_running = True

    def fail(self, error: StationError) -> None:
        super().fail(error)
        self.driver.stop()
        self.is_running = False
        if isinstance(error, StuckError):
            self.power_cycle()
        self.loop.after(RETRY_S, self.begin)

    @property
    def why(self) -> str:
        return self.links[-1][1]

    @property
    def steps(self) -> list[str]:
        """Reasons reported while the link was down, without immediate repetitions."""
        return [why for is_up, why in self.links if not is_up]


class Bench:
    """Bench with modem, machine and interface. The modem has power and has booted.

    options  options of the interface in addition to usb; bearer is `none` by default.
    """

    def __init__(self, loop, folder: Path, **options) -> None:
        self.loop = loop
        self.board = SimulatedMachine(folder)
        self.modem = SimulatedModem(
            loop, lambda device: self.board.plug(PLACE, device), lambda: self.board.unplug(PLACE)
        )
        self.system = FakeSystem(self.board.machine)
        table = {"usb": PLACE, "bearer": "none", "state_dir": str(folder), **options}
        shared = SHARED._replace(machine=self.board.machine)
        self.driver = Sim8202g(ModemOptions(**table), shared, self.system)
        self.station = Station(loop, self.driver)

    def power(self) -> None:
        """Switch the modem on, and wait until it appears at USB."""
        self.board.sit(PLACE, self.modem.supplied)
        self.loop.run_until(lambda: self.modem.is_plugged)

    def start(self) -> None:
        self.power()
        self.station.begin()

    def up(self, within: float = 120.0) -> None:
        """Start the interface, and wait for its link."""
        self.start()
        self.loop.run_until(lambda: self.station.is_up, within)

    def close(self) -> None:
        self.driver.stop()
        self.modem.close()
        self.board.close()
