"""The interfaces of a station, made from its configuration: driver, host and supervisor of each."""

from collections.abc import Callable, Iterator
from typing import TypeAlias

import zmq

from board.loop import Loop
from board.time import Fix, TimeMark
from drivers import DRIVERS
from drivers.contract import Driver, Shared, Witness
from drivers.wire.geonet_own import OwnPackets
from firmware.config import Config
from firmware.drops import Drops
from firmware.interface import Interface
from firmware.ipc import Ipc, IpcOptions
from firmware.place import Place
from firmware.router import Router
from firmware.signatures import Signatures
from firmware.simulation import Simulation
from firmware.supervisor import Supervised
from firmware.tables import QueueOptions
from firmware.timekeeper import Timekeeper
from firmware.timeline import Timeline
from firmware.topics import Topics

Context: TypeAlias = zmq.Context[zmq.Socket[bytes]]


class Interfaces:
    """Makes them; each is known to the router afterwards, and tells place, time and time line what it has to tell."""

    def __init__(
        self,
        loop: Loop,
        router: Router,
        topics: Topics,
        drops: Drops,
        place: Place,
        timekeeper: Timekeeper,
        timeline: Timeline,
        is_clock_set: Callable[[], bool],
        witness: Witness,
        signatures: Signatures,
    ) -> None:
        self._loop = loop
        self._router = router
        self._topics = topics
        self._drops = drops
        self._place = place
        self._timekeeper = timekeeper
        self._timeline = timeline
        self._is_clock_set = is_clock_set
        self._witness = witness
        self._signatures = signatures

    def make(self, config: Config, simulation: Simulation, context: Context) -> dict[str, Supervised]:
        """Those of the configuration and, where it wants interface processes, theirs."""
        accepts_any_port = config.tables.reception.unknown_btp_port == "deliver"
        made = {}
        for name, driver, options in self._drivers(config, simulation, context):
            made[name] = self._supervised(name, driver, options)
            if accepts_any_port:
                made[name].interface.accept_any_port()
        return made

    def _supervised(self, name: str, driver: Driver, options: QueueOptions) -> Supervised:
        interface = Interface(name, driver, options, self._loop, self._router, self._topics, self._drops)

        def fix(fix: Fix) -> None:
            self._place.fix(name, fix)
            self._timekeeper.fix(name, fix)

        def time_mark(mark: TimeMark) -> None:
            self._place.time_mark(name, mark)
            self._timekeeper.time_mark(name, mark)

        interface.on_fix, interface.on_time_mark = fix, time_mark
        interface.on_unverified = self._signatures.deliver
        interface.on_link = lambda is_up, why: self._timeline.note(name, f"{'up' if is_up else 'down'}: {why}")
        self._router.add(interface)
        return Supervised(self._loop, interface)

    def _drivers(
        self, config: Config, simulation: Simulation, context: Context
    ) -> Iterator[tuple[str, Driver, QueueOptions]]:
        station, reception, endpoint = config.tables.station, config.tables.reception, config.tables.endpoint
        shared = Shared(
            config.mac,
            frozenset(reception.gn_versions),
            reception.unverified == "deliver",
            frozenset(self._topics.ports),
            self._topics.lanes(),
            station.type,
            station.is_mobile,
            bool(station.mac),
            simulation.machine,
            tuple(kind.name for kind in self._topics.kinds),
            self._is_clock_set,
            self._witness,
            OwnPackets(),
        )
        for entry in config.interfaces:
            yield entry.name, DRIVERS[entry.queue.driver](simulation.played(entry.options), shared), entry.queue
        if endpoint.ipc_in or endpoint.ipc_out:
            ipc = Ipc(context, IpcOptions(endpoint.ipc_in, endpoint.ipc_out), self._topics, self._drops)
            yield "ipc", ipc, QueueOptions("ipc")
