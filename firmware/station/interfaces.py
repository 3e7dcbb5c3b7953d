"""Interfaces of a station: creates driver, host and supervisor of each."""

from collections.abc import Callable, Iterator
from typing import TypeAlias

import zmq

from board.time.scales import Fix, TimeMark
from drivers import DRIVERS
from drivers.contract import Driver, Shared, Witness
from drivers.wire.geonet.own import OwnPackets
from firmware.clock.timekeeper import Timekeeper
from firmware.config.captain_toml import Config
from firmware.config.tables import QueueOptions
from firmware.endpoint.ipc import Ipc, IpcOptions
from firmware.routing.interface import Interface, InterfaceListener
from firmware.routing.router import Routing
from firmware.station.interface_supervisor import InterfaceSupervisor
from firmware.station.position import OwnPosition
from firmware.station.signatures import Signatures
from firmware.station.simulation import Simulation
from firmware.station.timeline import Timeline

Context: TypeAlias = zmq.Context[zmq.Socket[bytes]]


class Reports(InterfaceListener):
    """Listener of one interface: passes its reports to own position, time, time line and signatures."""

    def __init__(
        self,
        name: str,
        own_position: OwnPosition,
        timekeeper: Timekeeper,
        timeline: Timeline,
        signatures: Signatures,
    ) -> None:
        self._name = name
        self._own_position = own_position
        self._timekeeper = timekeeper
        self._timeline = timeline
        self._signatures = signatures

    def link_changed(self, state: str, why: str) -> None:
        self._timeline.note(self._name, f"{state}: {why}")

    def fix(self, fix: Fix) -> None:
        self._own_position.fix(self._name, fix)
        self._timekeeper.fix(self._name, fix)

    def time_mark(self, mark: TimeMark) -> None:
        self._own_position.time_mark(self._name, mark)
        self._timekeeper.time_mark(self._name, mark)

    def delivered_unverified(self) -> None:
        self._signatures.deliver()


class Interfaces:
    """Factory of the interfaces: adds them to the router, and passes their reports to position, time and time line."""

    def __init__(
        self,
        routing: Routing,
        own_position: OwnPosition,
        timekeeper: Timekeeper,
        timeline: Timeline,
        is_clock_set: Callable[[], bool],
        witness: Witness,
        signatures: Signatures,
    ) -> None:
        self._loop, self._topics, self._drops, self._router = routing
        self._own_position = own_position
        self._timekeeper = timekeeper
        self._timeline = timeline
        self._is_clock_set = is_clock_set
        self._witness = witness
        self._signatures = signatures

    def make(self, config: Config, simulation: Simulation, context: Context) -> dict[str, InterfaceSupervisor]:
        """Create the configured interfaces, and `ipc` if interface processes are configured. Return them by name."""
        accepts_any_port = config.tables.reception.unknown_btp_port == "deliver"
        made = {}
        for name, driver, options in self._drivers(config, simulation, context):
            made[name] = self._supervised(name, driver, options)
            if accepts_any_port:
                made[name].interface.accept_any_port()
        return made

    def _supervised(self, name: str, driver: Driver, options: QueueOptions) -> InterfaceSupervisor:
        interface = Interface(name, driver, options, self._loop, self._router, self._topics, self._drops)
        interface.listener = Reports(name, self._own_position, self._timekeeper, self._timeline, self._signatures)
        self._router.add(interface)
        return InterfaceSupervisor(self._loop, interface)

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
