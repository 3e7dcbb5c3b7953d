"""A whole station on the simulated board in this process, on a clock that jumps: what the virtual runs play on.

All of the station is real, its sockets too, and all of the simulated board but what processes of their own do:
processes.py plays those. The air of the radio is not played, so neighbours are left out of the board file.
"""

import itertools
import logging
import os
import random
import socket
import time
from collections import Counter, deque
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from board.runtime import worker
from drivers.message import Confirm, Indication
from drivers.sim import board as simulated_board
from drivers.sim.modules import Radio
from drivers.sim.trouble import BOARD
from drivers.udp.driver import Udp
from firmware.clock import pulsed_time
from firmware.config import board_file, captain_toml
from firmware.routing.interface import Interface
from firmware.slots.states import SlotState
from firmware.station.interface_supervisor import InterfaceSupervisor
from firmware.station.station import Station
from pps import pulse
from pps.pulse import Clocks
from tests.proof.chaos.patient import WORKER
from tests.proof.chaos.processes import PlayedChild, PlayedRadio
from tests.ptys import PtyLoop, Ptys

INTERFACES = {"gnss": "gnss", "v2x": "g5", "cellular": "cellular"}  # by slot
POLL_S = 0.25  # of the simulated board, which looks ten times a second in real time: files take time to read
FLOW_S = 0.5  # between two messages each way over the interface beside
DRAIN_S = 15.0  # longer than a CAM lives
CAM = bytes.fromhex("020200000539")


class StageLoop(PtyLoop):
    """Tells what there is still to come."""

    def pending(self) -> int:
        """Timers that will be called."""
        return sum(timer.is_pending for _, _, timer in self._timers)


class Journal(logging.Handler):
    """Keeps the lines of the station.

    most  lines within WINDOW_S.
    """

    WINDOW_S = 10.0

    def __init__(self, clock: Callable[[], float]) -> None:
        super().__init__(logging.INFO)
        self.lines: list[str] = []
        self.most = 0
        self._clock = clock
        self._at: deque[float] = deque()

    def emit(self, record: logging.LogRecord) -> None:
        now = self._clock()
        self.lines.append(f"{now:.1f} {record.name}: {record.levelname}: {record.getMessage()}")
        self._at.append(now)
        while self._at[0] < now - self.WINDOW_S:
            self._at.popleft()
        self.most = max(self.most, len(self._at))


class Stage:
    """A patient.Theatre: a station with an interface beside its slots, and messages both ways over that."""

    def __init__(self, folder: Path, patch: pytest.MonkeyPatch, seed: int) -> None:
        random.seed(seed)
        self.loop = StageLoop(Ptys(patch))
        self.journal = Journal(self.loop.clock)
        patch.setattr(simulated_board, "POLL_S", POLL_S)
        clocks = self._clocks(time.time_ns())
        patch.setattr(pulse, "read_clocks", clocks)
        patch.setattr(pulsed_time, "raw_ns", lambda: clocks().raw_ns)
        patch.setattr(worker, "Child", PlayedChild)
        patch.setattr(worker, "jitter", random.random)
        patch.setattr(Radio, "say", lambda radio, words: PlayedRadio.tell(words))
        patch.setattr(InterfaceSupervisor, "start", self._started(InterfaceSupervisor.start))
        PlayedChild.running = []
        PlayedRadio.sent = 0
        self.two_drivers: list[str] = []
        self._peer = socket.socket(socket.AF_INET, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
        self._peer.bind(("127.0.0.1", 0))
        wanted = self._config(folder)
        self.station = Station(self.loop, wanted, captain_toml.ConfigSource())
        self._flow()

    def _clocks(self, start_ns: int) -> Callable[[], Clocks]:
        """A machine whose clocks are all right, and go as the loop's does."""
        began = self.loop.now

        def clocks() -> Clocks:
            ns = round((self.loop.now - began) * 1e9)
            return Clocks(start_ns + ns, ns, self.loop.now)

        return clocks

    def close(self) -> None:
        logging.getLogger("captain").removeHandler(self.journal)
        self.station.close()
        self.loop.close()
        self._peer.close()

    def start(self) -> None:
        logging.getLogger("captain").addHandler(self.journal)
        logging.getLogger("captain").setLevel(logging.INFO)
        self.station.start()

    @property
    def folder(self) -> Path:
        """Of the simulated board."""
        assert self.station._simulation.board is not None
        return self.station._simulation.board.machine.sys.parent

    # patient.Theatre

    def now(self) -> float:
        return self.loop.now

    def obey(self, text: str) -> None:
        if text == f"begin {WORKER}":
            for child in [child for child in PlayedChild.running if child.name == "sim-board"]:
                child.crash()
        elif text != f"end {WORKER}":
            assert self.station._simulation.board is not None
            self.station._simulation.board.troubles.obey(text)

    def is_up(self, name: str) -> bool:
        carrier = self.station._carrier
        assert carrier is not None
        if name == BOARD:
            return carrier.worker.is_up and not carrier.health.complaints
        return carrier.slots[name].state is SlotState.RUNNING and self.interface(name).is_up

    def is_in_fault(self, name: str) -> bool:
        assert self.station._carrier is not None
        return name != BOARD and self.station._carrier.slots[name].state is SlotState.FAULT

    def interface(self, slot: str) -> Interface:
        return self.station.router.interfaces[INTERFACES[slot]]

    # what has to stay as it is

    def held(self) -> tuple[int, int]:
        """Sources of the loop, and descriptors of the process."""
        return len(self.loop._sources), len(os.listdir("/proc/self/fd"))

    @property
    def workers(self) -> list[str]:
        """Those that run."""
        return sorted(child.name for child in PlayedChild.running)

    # messages

    def _flow(self) -> None:
        """Count what is sent and received at all ends."""
        self.sent_in = self.heard_in = self.requested = self.heard_out = self.handed_to_radio = 0
        self.outcomes: Counter[tuple[str, str, str]] = Counter()
        router = self.station.router
        self._users, router.users = router.users, self
        router.set_listeners([], [self])
        self._numbers = itertools.count(1)

    def publish(self, indications: list[Indication]) -> None:
        """Count what goes to the users, and pass it on."""
        self.heard_in += sum(indication.interface == "beside" for indication in indications)
        assert self._users is not None
        self._users.publish(indications)

    def confirm(self, confirm: Confirm, targets: Sequence[Interface]) -> None:
        """Count what becomes of requests."""
        reason = str(confirm.reason.value) if confirm.reason else ""
        self.outcomes[confirm.interface, confirm.outcome.value, reason] += 1
        self.handed_to_radio += any(target.name == "g5" for target in targets)

    def flow(self) -> None:
        """Messages each way, for as long as the loop turns."""
        router = self.station.router
        beside = router.interfaces["beside"]
        assert isinstance(beside.driver, Udp)
        address = beside.driver.address
        kind = self.station.topics.by_number[2]

        def step() -> None:
            if self.is_flowing:
                pdu = CAM + next(self._numbers).to_bytes(4, "big")
                self._peer.sendto(pdu, tuple(address))
                self.sent_in += 1
                router.request(kind, CAM + next(self._numbers).to_bytes(4, "big"), "test")
                self.requested += 1
            self._hear()

        self.is_flowing = True
        self.loop.every(FLOW_S, step)

    def end_flow(self) -> None:
        """Send no more, and let what has been sent arrive or be dropped."""
        self.is_flowing = False
        self.loop.run_for(DRAIN_S)

    def _hear(self) -> None:
        try:
            while True:
                self._peer.recv(2048)
                self.heard_out += 1
        except BlockingIOError:
            return

    # setting up

    def _config(self, folder: Path) -> captain_toml.Config:
        text = (board_file.BOARDS / "sim.toml").read_text().partition("[neighbours]")[0]
        (folder / "board.toml").write_text(text)
        (folder / "captain.toml").write_text(
            f"[endpoint]\ncontrol = '{folder}/control'\nfrom_users = 0\nto_users = 0\npull = 0\nreport = 0\n"
            "[interfaces.gnss]\nrate_hz = 1\n"
            "[interfaces.beside]\ndriver = 'udp'\nframing = 'pdu'\nlisten = '127.0.0.1:0'\n"
            f"peers = ['127.0.0.1:{self._peer.getsockname()[1]}']\n"
        )
        return captain_toml.load(str(folder / "captain.toml"), (), str(folder / "board.toml"))

    def _started(self, start: Callable[[InterfaceSupervisor], None]) -> Callable[[InterfaceSupervisor], None]:
        """InterfaceSupervisor.start, which must not be called while its driver runs."""

        def started(one: InterfaceSupervisor) -> None:
            if one._state in ("starting", "running"):
                self.two_drivers.append(one.interface.name)
            start(one)

        return started
