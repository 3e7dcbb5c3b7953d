"""Station: creates all parts, starts, reloads and stops them."""

import gc
import logging
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from board.runtime.errors import RequestError
from board.runtime.loop import Loop
from board.time.scales import ITS_END, TimeQuality
from drivers.contract import Answer, Can, Parting, Witness
from drivers.message import MessageType
from drivers.reason import Reason
from firmware.clock.clock_set import ClockSet
from firmware.clock.timekeeper import FRESH_S, Timekeeper
from firmware.config.board_file import Board
from firmware.config.captain_toml import Config, ConfigSource
from firmware.config.tables import Tables
from firmware.endpoint.control.question import Commands, Question
from firmware.endpoint.endpoint import Endpoint, StationQueries
from firmware.endpoint.report import process_status
from firmware.routing.drops import Drops
from firmware.routing.duplicates import Duplicates
from firmware.routing.policy import Policy
from firmware.routing.router import Router, Routing
from firmware.station import bearers
from firmware.station.interface_supervisor import InterfaceSupervisor
from firmware.station.interfaces import Interfaces
from firmware.station.notify import ServiceNotice
from firmware.station.operator import Operator
from firmware.station.own_types import OwnTypes, type_row
from firmware.station.position import OwnPosition
from firmware.station.signatures import Signatures
from firmware.station.simulation import Simulation
from firmware.station.storage import Storage
from firmware.station.timeline import Timeline
from firmware.topics import Topics

if TYPE_CHECKING:
    from firmware.config.reload import Reload
    from firmware.station.carrier import Carrier
    from firmware.station.recording import Recorder

# Seconds. A stop takes less than a second altogether. Messages of users are accepted for FINISH_S (endpoint.py). Then
# queues are drained for DRAIN_S, and libzmq sends published messages for LINGER_MS (publisher.py).
DRAIN_S = 0.4
DRAIN_STEP_S = 0.02
# Seconds. Time for two reloads of READ_S each (reload.py), because a request during a reload waits for the next one.
RELOAD_S = 121.0

log = logging.getLogger("captain")


class Station:
    """Station: all its parts, on one event loop.

    config  configuration of the station.
    source  files of the configuration, for a reload.

    Raises StationError if a socket of the endpoint cannot be opened. Interfaces that cannot start are retried instead.
    """

    def __init__(self, loop: Loop, config: Config, source: ConfigSource) -> None:
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
        self._is_clock_set = ClockSet()
        self.own_position = OwnPosition(
            loop.clock, tables.station.position, tables.station.is_mobile, self._is_clock_set
        )
        self.timeline = Timeline(loop.clock)
        self.router = Router(loop, self.topics, self.drops, self.own_position.ego, self.own_position.its_ms)
        self._simulation = Simulation(loop, config.board)
        self.timekeeper = Timekeeper(
            loop, tables.time, config.board.pulse, self.own_position.time, self._time_is, self._simulation
        )
        self.router.quality_source = self.timekeeper
        window_s = 0.0 if is_legacy else tables.reception.duplicate_window_s
        self.duplicates = Duplicates(window_s, self.drops, self.topics)
        self.router.set_policy(Policy(tables.policy, self.topics, self.router))
        self._interfaces: dict[str, InterfaceSupervisor] = {}
        self._carrier: Carrier | None = None
        self._recorder: Recorder | None = None
        self._operator = Operator(
            loop, self._interfaces, lambda: self._carrier, self.own_position, self.timekeeper.status, self.timeline
        )
        local = self.own_position.ego if tables.endpoint.local_info and not is_legacy else None
        self._signatures = Signatures(tables.reception.unverified)
        witness = Witness()
        routing = Routing(loop, self.topics, self.drops, self.router)
        own_id = int.from_bytes(config.mac[2:], "big") if tables.station.id is None else tables.station.id
        side = StationQueries(local, self.status, self._refresh, self.timekeeper.status, self._commands(), own_id)
        has_recorder = bool(tables.recorder.folder)
        self.endpoint = Endpoint(routing, tables.endpoint, side, config.mac, witness, has_recorder)
        interfaces = Interfaces(
            routing,
            self.own_position,
            self.timekeeper,
            self.timeline,
            self._is_clock_set,
            witness,
            self._signatures,
        )
        self._interfaces |= interfaces.make(config, self._simulation, self.endpoint.context)
        # A single receiving interface needs no duplicate suppression.
        if self.duplicates.window_s and len(self._with(Can.RECEIVE)) > 1:
            self.router.stages = (self.duplicates,)
        self._carrier = self._made_carrier(config.board)
        self._recorder = self._made_recorder()
        bearers.join(self._interfaces)

    def start(self) -> None:
        """Start the simulation, all interfaces without a slot, the slots and the other parts; then report readiness."""
        self._simulation.start()
        for name, interface in self._interfaces.items():
            if not self._slot_of(name):
                interface.start()
        if self._carrier is not None:
            self._carrier.start()
        self.endpoint.start()
        OwnTypes(self.loop, self.topics, self._add_kind).start()
        self.storage.start()
        self.timekeeper.start(self._with(Can.TIMEMARK))
        if self._recorder is not None:
            self._recorder.start()
        # The objects created so far stay until the end: freeze() saves the garbage collector from examining them again.
        gc.collect()
        gc.freeze()
        if not self._interfaces:
            log.warning("no interface is configured: no messages are sent or received; add a table [interfaces.<name>]")
        if not self._is_clock_set():
            now_s = time.time()
            now = time.strftime("%Y-%m-%d %H:%M:%S", time.gmtime(now_s))
            what = "not set" if now_s < ITS_END else "later than the last ITS time, in 2143"
            log.warning("clock: %s: %s; own position is unknown and V2N waits until GNSS or NTP sets it", now, what)
        self._notice.send(f"READY=1\nSTATUS=routing over {len(self._interfaces)} interfaces")
        self._notice.watch(self.loop)

    def reread(self) -> None:
        """Reload the policy, and report begin and end to the service manager."""
        self._notice.send(f"RELOADING=1\nMONOTONIC_USEC={time.monotonic_ns() // 1000}")
        self.reload(lambda answer: self._notice.send("READY=1"))

    def reload(self, answer: Answer) -> None:
        """Read the configuration again and replace the policy. If there is an error, the old policy is kept."""
        if self._reload is None:
            from firmware.config.reload import Reload

            self._reload = Reload(
                self.loop,
                self._source,
                self.config,
                lambda: Policy((), self.topics, self.router),
                self.router.set_policy,
                lambda: [row.name for row in self.router.policy.rows],
            )
        self._reload.ask(answer)

    def _add_kind(self, kind: MessageType) -> None:
        self.router.add_kind(kind)
        self.endpoint.add_kind(kind)
        if self._reload is not None:
            self._reload.add_kind(kind)

    def stop(self) -> None:
        """Stop accepting messages, drain the queues for at most DRAIN_S, then end the loop.

        Slots keep their power, so that a restart of the station does not restart its modules. A second call has no
        effect.
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
        """Close all parts, in any state: after stop(), or during a failure."""
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
        self.endpoint.finish_reports()  # before the recorder is ended, so that it receives the last reports
        if self._recorder is not None:
            self._recorder.finish()
        self.endpoint.close()

    def selftest(self, answer: Answer) -> None:
        """Test each declared part, once all work or the time is over; `answer` receives the rows."""
        self._operator.selftest({}, answer)

    def status(self) -> dict[str, object]:
        """Update all counters and return the status object.

        station        name of the station.
        profile        table of message types: `standard` or `legacy`.
        types          names of the message types that it knows: those of the profile, of [[types]] and added ones.
        configuration  digest of the whole configuration. Stations with the same digest are configured alike.
        is_clock_set   true if the system clock was set since boot. On a machine without a real-time clock it is false
                       until NTP or GNSS sets it. Until then time stamps are wrong, the own position has no time, and
                       V2N waits.
        clock          station time, its source and its accuracy: the object of `time.`.
        position       own position.
        storage        folder for files that outlive a restart; absent without STATE_DIRECTORY of systemd.
        interfaces     object of each interface, by name.
        simulation.hears  UDP address and port at which it receives simulated stations; absent without such stations.
        board          the board; absent if no hardware is declared.
        recorder       the recorder; absent without `recorder.folder`.
        security       verification of signatures.
        drops          drops: a row for each place and reason.
        duplicates     messages that several interfaces have delivered.
        policy         rows of the policy.
        """
        self._refresh()
        return {
            "station": self.config.tables.station.name,
            "profile": self.config.tables.station.profile,
            "types": self.topics.names(),
            "configuration": self.config.digest,
            **process_status(self._started, self.loop.clock()),
            "is_clock_set": self._is_clock_set(),
            "clock": self.timekeeper.status(),
            "position": self.own_position.status(),
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
        """Flush indications and update the counters from the kernel, so that the sums in the status agree."""
        self.router.flush()
        self.duplicates.expire(self.loop.clock())
        for interface in self._interfaces.values():
            interface.refresh()

    def _with(self, ability: Can) -> list[str]:
        """Return the names of the interfaces with an ability."""
        return [one.name for one in self.router.interfaces.values() if ability in one.driver.capabilities.can]

    def _time_is(self, quality: TimeQuality) -> None:
        self.router.quality = quality
        self.router.quality_until = self.loop.clock() + FRESH_S

    def _slot_of(self, name: str) -> str:
        return self._interfaces[name].interface.slot

    def _made_carrier(self, board: Board) -> "Carrier | None":
        """Return the carrier board; None if the board file declares no hardware, without an import of its code."""
        if not board.has_hardware:
            return None
        from firmware.station.carrier import Carrier

        in_slots = {self._slot_of(name): entry for name, entry in self._interfaces.items() if self._slot_of(name)}
        return Carrier(
            self.loop, board, self._simulation.machine, in_slots, self.timeline.note, self._simulation.worker
        )

    def _made_recorder(self) -> "Recorder | None":
        """Return the recorder; None without the option recorder.folder, without an import of its code."""
        if not self.config.tables.recorder.folder:
            return None
        from firmware.station.recording import Recorder

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
    """Return the table of message types of a station: its profile's, with the rows of [[types]]."""
    return Topics(tables.station.profile, map(type_row, tables.types))
