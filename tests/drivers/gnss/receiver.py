"""Bench of a receiver interface with a simulated receiver at its other end."""

from dataclasses import replace

from drivers.gnss.driver import ZedF9p
from drivers.gnss.options import GnssOptions
from drivers.sim.receiver.habits import Habits
from drivers.sim.receiver.receiver import Receiver
from drivers.sim.track import Track
from tests.drivers.host import SHARED, Host
from tests.virtual import VirtualLoop

UTC = 1_780_300_800  # 2026-06-01T08:00:00Z: start time of the simulated receivers


class Bench:
    """Interface with a simulated receiver that has booted; start() starts the interface."""

    def __init__(self, loop: VirtualLoop, habits: Habits | None = None, speed_m_s: float = 13.9, **options) -> None:
        self.loop = loop
        self.host = Host(loop)
        self.track = Track(speed_m_s=speed_m_s)
        self.receiver = Receiver(loop, habits, self.track)
        self.receiver.power(True)
        loop.run_until(lambda: self.receiver.boots == 1)
        options = {"rate_hz": 1, "receiver_port": self.receiver.habits.port, **options}
        self.options = GnssOptions(port=self.receiver.path, **options)
        self.driver = ZedF9p(self.options, SHARED)

    def start(self) -> "Bench":
        self.driver.start(self.host)
        return self

    def up(self) -> "Bench":
        """Start, and wait for the link and a first position."""
        self.start()
        self.loop.run_until(lambda: self.host.failures or (self.host.is_up and self.has_fix()))
        assert self.host.failures == []
        return self

    def has_fix(self) -> bool:
        return bool(self.host.fixes) and self.host.fixes[-1].latitude is not None

    def details(self) -> dict[str, object]:
        """Return the details that the status shows now."""
        return self.operate("status")

    def operate(self, do: str, **arguments):
        answers = []
        self.driver.operate(do, arguments, answers.append)
        assert len(answers) == 1
        return answers[0]

    def again(self, **options) -> "Bench":
        """Stop this interface and return another one to the same receiver."""
        self.driver.stop()
        self.host = Host(self.loop)
        self.options = replace(self.options, port=self.receiver.path, **options)
        self.driver = ZedF9p(self.options, SHARED)
        return self

    def close(self) -> None:
        self.driver.stop()
        self.receiver.unplug()

    def gps_s(self) -> float:
        return self.receiver.gps_ms() / 1000
