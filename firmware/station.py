"""The station: everything that runs, put together, started, re-read and stopped."""

import gc
import logging
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from board.errors import RequestError
from board.loop import Loop
from board.time import ITS_END, TimeQuality
from drivers.contract import Answer, Can, Parting, Witness
from drivers.reason import Reason
from firmware import bearers
from firmware.board_file import Board
from firmware.config import Config, Source
from firmware.drops import Drops
from firmware.duplicates import Duplicates
from firmware.endpoint import Endpoint
from firmware.interfaces import Interfaces
from firmware.made_up import ClockSet
from firmware.notify import ServiceNotice
from firmware.operator import Operator
from firmware.place import Place
from firmware.policy import Policy
from firmware.question import Commands, Question
from firmware.report import process_status
from firmware.router import Router
from firmware.signatures import Signatures
from firmware.simulation import Simulation
from firmware.storage import Storage
from firmware.supervisor import Supervised
from firmware.tables import Tables
from firmware.timekeeper import FRESH_S, Timekeeper
from firmware.timeline import Timeline
from firmware.topics import Topics, TypeRow

if TYPE_CHECKING:
    from firmware.carrier import Carrier
    from firmware.recording import Recorder
    from firmware.reload import Reload

# A stop takes less than a second: what users have handed over is taken for a moment (endpoint.py), what is queued may
# leave for DRAIN_S, and libzmq has its LINGER_MS for what is published.
DRAIN_S = 0.4
DRAIN_STEP_S = 0.02
# Two readings of READ_S each (reload.py): a reload that is asked for during another one waits for the next.
RELOAD_S = 121.0

log = logging.getLogger("captain")


class Station:
    """One station on one loop.

    config  as read; source  where it is read again for a new policy.
    Raises StationError when a socket of the endpoint cannot be had; interfaces that cannot start are tried
    again.
    """

    def __init__(self, loop: Loop, config: Config, source: Source) -> None:
        self.loop = loop
        self.config = config
        self._source = source
        self._reload: Reload | None = None
        self._started = loop.clock()
        self._is_stopping = False
        self._notice = ServiceNotice()
        tables = config.tables
        is_legacy = tables.station.profile == "legacy"
        self.topics = topics_of(tables)
        self.drops = Drops()
        self.storage = Storage(loop)
        self.place = Place(loop.clock, tables.station.position, tables.station.is_mobile)
        self.place.time.is_system_set = self._is_clock_set = ClockSet()
        self.timeline = Timeline(loop.clock)
        self.router = Router(loop, self.topics, self.drops, self.place.ego)
        self._simulation = Simulation(loop, config.board)
        self.timekeeper = Timekeeper(
            loop, tables.time, config.board.pulse, self.place.time, self._time_is, self._simulation
        )
        self.router.renew_quality = self.timekeeper.renew
        window_s = 0.0 if is_legacy else tables.reception.duplicate_window_s
        self.duplicates = Duplicates(window_s, self.drops, self.topics)
        self.router.set_policy(Policy(tables.policy, self.topics, self.router))
        self._interfaces: dict[str, Supervised] = {}
        self._carrier: Carrier | None = None
        self._recorder: Recorder | None = None
        local = self.place.ego if tables.endpoint.local_info and not is_legacy else None
        self._signatures = Signatures(tables.reception.unverified)
        witness = Witness()
        self.endpoint = Endpoint(
            loop,
            tables.endpoint,
            self.topics,
            self.drops,
            self.router,
            local,
            self.status,
            self._refresh,
            self.timekeeper.status,
            self._commands(),
            config.mac,
            witness,
            has_recorder=bool(tables.recorder.folder),
        )
        interfaces = Interfaces(
            loop,
            self.router,
            self.topics,
            self.drops,
            self.place,
            self.timekeeper,
            self.timeline,
            self._is_clock_set,
            witness,
            self._signatures,
        )
        self._interfaces |= interfaces.make(config, self._simulation, self.endpoint.context)
        # Where there is one way in, nothing comes by two.
        if self.duplicates.window_s and len(self._with(Can.RECEIVE)) > 1:
            self.router.stages = (self.duplicates,)
        self._carrier = self._made_carrier(config.board)
        self._recorder = self._made_recorder()
        bearers.join(self._interfaces)

    def start(self) -> None:
        """Start what is simulated, every interface that sits in no slot, then the slots; say that all runs."""
        self._simulation.start()
        for name, interface in self._interfaces.items():
            if not self._slot_of(name):
                interface.start()
        if self._carrier is not None:
            self._carrier.start()
        self.endpoint.start()
        self.storage.start()
        self.timekeeper.start(self._with(Can.TIMEMARK))
        if self._recorder is not None:
            self._recorder.start()
        # What is there now stays: the collector need not look at it again.
        gc.collect()
        gc.freeze()
        if not self._interfaces:
            log.warning("no interface is configured: nothing is sent or received; see [interfaces.<name>]")
        if not self._is_clock_set():
            now_s = time.time()
            now = time.strftime("%Y-%m-%d %H:%M:%S", time.gmtime(now_s))
            what = "not set" if now_s < ITS_END else "later than the last ITS time, in 2143"
            log.warning("clock: %s: %s; own position is unknown and V2N waits until GNSS or NTP sets it", now, what)
        self._notice.send(f"READY=1\nSTATUS=routing over {len(self._interfaces)} interfaces")
        self._notice.watch(self.loop)

    def reread(self) -> None:
        """As reload(), for the service manager, which is told when it is done."""
        self._notice.send(f"RELOADING=1\nMONOTONIC_USEC={time.monotonic_ns() // 1000}")
        self.reload(lambda answer: self._notice.send("READY=1"))

    def reload(self, answer: Answer) -> None:
        """Read the configuration again and take its policy; a wrong one leaves the old one in force."""
        if self._reload is None:
            from firmware.reload import Reload

            self._reload = Reload(
                self.loop,
                self._source,
                self.config,
                lambda: Policy((), self.topics, self.router),
                self.router.set_policy,
                lambda: [row.name for row in self.router.policy.rows],
            )
        self._reload.ask(answer)

    def stop(self) -> None:
        """Take nothing more, let what is queued leave for DRAIN_S, then end the loop. Idempotent.

        Slots keep their power: a restart of the station is none of its modules.
        """
        if self._is_stopping:
            return
        self._is_stopping = True
        self._notice.send("STOPPING=1")
        self.endpoint.finish()
        self.storage.stop()
        self._simulation.finish()
        self._drain(self.loop.clock() + DRAIN_S)

    def close(self) -> None:
        """Close everything, whatever state it is in: after stop() or in the middle of a failure."""
        self.endpoint.close_inlets()
        self.timekeeper.stop()
        for interface in self._interfaces.values():
            interface.interface.outlet.drop_all(Reason.STOPPED)
            interface.stop()
        if self._reload is not None:
            self._reload.close()
        if self._carrier is not None:
            self._carrier.close()
        for interface in self._interfaces.values():
            if isinstance(driver := interface.interface.driver, Parting):
                driver.part()
        self._simulation.stop()
        self.router.flush()
        self.endpoint.tell()  # the recorder hears it
        if self._recorder is not None:
            self._recorder.finish()
        self.endpoint.close()

    def selftest(self, answer: Answer) -> None:
        """Look at each thing that is declared, once all has come up; answer is given the rows."""
        self._operator.selftest({}, answer)

    def status(self) -> dict[str, object]:
        """The status object, its counters up to date."""
        self._refresh()
        return {
            "station": self.config.tables.station.name,
            "profile": self.config.tables.station.profile,
            "configuration": self.config.digest,
            **process_status(self._started, self.loop.clock()),
            "is_clock_set": self._is_clock_set(),
            "clock": self.timekeeper.status(),
            "position": self.place.status(),
            **({"storage": told} if (told := self.storage.status()) else {}),
            "interfaces": {name: entry.status() for name, entry in self._interfaces.items()},
            **({"simulation": {"hears": heard_at}} if (heard_at := self._simulation.heard_at) else {}),
            **({"board": self._carrier.status()} if self._carrier else {}),
            **({"recorder": self._recorder.status()} if self._recorder else {}),
            **self.endpoint.status(),
            "security": self._signatures.status(),
            "drops": list(self.drops.status()),
            "duplicates": self.duplicates.status(),
            "policy": self.router.policy.status(),
        }

    def _refresh(self) -> None:
        """Bring the counters up to date, so that their sums match: what the users get, what the kernel dropped."""
        self.router.flush()
        self.duplicates.expire(self.loop.clock())
        for interface in self._interfaces.values():
            interface.refresh()

    def _with(self, ability: Can) -> list[str]:
        """Names of the interfaces that have it."""
        return [one.name for one in self.router.interfaces.values() if ability in one.driver.capabilities.can]

    def _time_is(self, quality: TimeQuality) -> None:
        self.router.quality = quality
        self.router.quality_until = self.loop.clock() + FRESH_S

    def _slot_of(self, name: str) -> str:
        return self._interfaces[name].interface.slot

    def _made_carrier(self, board: Board) -> "Carrier | None":
        """What brings up the board; a board file that declares no hardware costs nothing."""
        if not board.has_hardware:
            return None
        from firmware.carrier import Carrier

        in_slots = {self._slot_of(name): entry for name, entry in self._interfaces.items() if self._slot_of(name)}
        return Carrier(
            self.loop, board, self._simulation.machine, in_slots, self.timeline.note, self._simulation.worker
        )

    def _made_recorder(self) -> "Recorder | None":
        """Nothing where [recorder] names no folder, and then nothing is imported for it."""
        if not self.config.tables.recorder.folder:
            return None
        from firmware.recording import Recorder

        return Recorder(
            self.loop, self.config.tables.recorder, self.config.tables.endpoint, self.endpoint.private_report
        )

    def _record(self, question: Question) -> dict[str, object]:
        if self._recorder is None:
            raise RequestError("the station has no recorder", "name a folder: [recorder] in captain.toml")
        return self._recorder.trigger(question)

    def _commands(self) -> Commands:
        def done(act: Callable[[], None]) -> dict[str, object]:
            act()
            return {}

        self._operator = Operator(
            self.loop, self._interfaces, lambda: self._carrier, self.place, self.timekeeper.status, self.timeline
        )
        return Commands(
            {
                "status": lambda _: {"status": self.status()},
                "stop": lambda _: done(self.stop),
                "time": self.timekeeper.told,
                "record": self._record,
                **self._operator.now,
            },
            {"reload": lambda _, answer: self.reload(answer), **self._operator.later},
            {"reload": RELOAD_S},
        )

    def _drain(self, until: float) -> None:
        outlets = [interface.outlet for interface in self.router.interfaces.values()]
        if self.loop.clock() >= until or all(outlet.is_empty for outlet in outlets):
            self.loop.stop()
            return
        self.loop.after(DRAIN_STEP_S, lambda: self._drain(until))


def topics_of(tables: Tables) -> Topics:
    """The types that a station with these tables has."""
    return Topics(
        tables.station.profile,
        [
            TypeRow(row.number, row.name, row.btp_port, row.btp_port, row.priority, row.lifetime_s, row.traffic_class)
            for row in tables.types
        ],
    )
