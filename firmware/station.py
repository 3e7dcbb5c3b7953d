"""The station: everything that runs, put together, started, re-read and stopped."""

import gc
import logging
import time
from collections.abc import Callable

import zmq

from board.errors import StationError
from board.loop import Loop
from board.time import EPOCH, its_time_ms, leap_seconds
from drivers import DRIVERS
from drivers.contract import Driver, Shared
from drivers.message import Ego, Position
from drivers.reason import Reason
from drivers.sim.neighbours import Neighbours
from firmware.config import Config
from firmware.control_socket import ControlSocket, default_path
from firmware.drops import Drops
from firmware.duplicates import Duplicates
from firmware.inlet import Inlet
from firmware.interface import Interface
from firmware.ipc import Ipc, IpcOptions
from firmware.notify import ServiceNotice
from firmware.policy import Policy
from firmware.publisher import Publisher
from firmware.question import Commands
from firmware.report import CONFIRM, STATUS, Report, process_status
from firmware.router import Router
from firmware.supervisor import Supervised
from firmware.tables import QueueOptions
from firmware.topics import Topics, TypeRow
from firmware.users import Users

# A stop takes less than a second: what users have handed over is taken for FINISH_S, what is queued may leave for
# DRAIN_S, and libzmq has its LINGER_MS for what is published.
FINISH_S = 0.2
DRAIN_S = 0.4
DRAIN_STEP_S = 0.02

log = logging.getLogger("captain")


class Station:
    """One station on one loop.

    config  as read; reload  reads it again for a new policy.
    Raises StationError when a socket of the endpoint cannot be had; interfaces that cannot start are tried
    again.
    """

    def __init__(self, loop: Loop, config: Config, reload: Callable[[], Config]) -> None:
        self.loop = loop
        self.config = config
        self._reload = reload
        self._started = loop.clock()
        self._is_stopping = False
        self._notice = ServiceNotice()
        self._context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        tables = config.tables
        self.topics = Topics(
            tables.station.profile,
            [
                TypeRow(
                    row.number, row.name, row.btp_port, row.btp_port, row.priority, row.lifetime_s, row.traffic_class
                )
                for row in tables.types
            ],
        )
        self.drops = Drops()
        self.router = Router(loop, self.topics, self.drops, self.ego)
        self._place, self._is_placed = _place(config)
        is_legacy = tables.station.profile == "legacy"
        self.duplicates = Duplicates(0.0 if is_legacy else tables.reception.duplicate_window_s, self.drops)
        if self.duplicates.window_s:
            self.router.stages = (self.duplicates,)
        self.router.set_policy(Policy(tables.policy, self.topics, self.router))
        try:
            self._open_endpoint(is_legacy)
        except StationError:
            self._context.destroy(linger=0)  # those sockets that could be had
            raise
        self._interfaces = [self._supervised(name, driver, queue) for name, driver, queue in self._drivers()]
        sim = config.board.neighbours
        self._neighbours = Neighbours(loop, sim) if sim else None

    def start(self) -> None:
        """Start every interface and say that the station is ready."""
        for interface in self._interfaces:
            interface.start()
        if self._neighbours is not None:
            self._neighbours.start()
        self.users.start()
        self.report.start()
        # What is there now stays: the collector need not look at it again.
        gc.collect()
        gc.freeze()
        if not self._interfaces:
            log.warning("no interface is configured: nothing is sent or received; see [interfaces.<name>]")
        if time.time() < EPOCH:
            log.warning("the clock is not set (it says %.0f s since 1970): own position counts as unknown", time.time())
        self._notice.send(f"READY=1\nSTATUS=routing over {len(self._interfaces)} interfaces")
        self._notice.watch(self.loop)

    def reread(self) -> None:
        """Read the configuration again and take its policy; a wrong one leaves the old one in force."""
        self._notice.send(f"RELOADING=1\nMONOTONIC_USEC={time.monotonic_ns() // 1000}")
        try:
            self.reload_policy()
        except StationError as error:
            log.error("the policy stays as it was: %s", error)
        self._notice.send("READY=1")

    def reload_policy(self) -> None:
        """As reread(), but raises ConfigurationError."""
        config = self._reload()
        changed = _changed_besides_policy(self.config, config)
        if changed:
            log.warning("%s changed too: only [[policy]] is taken without a restart", ", ".join(changed))
        self.router.set_policy(Policy(config.tables.policy, self.topics, self.router))
        log.info("policy read again: %d rows", len(config.tables.policy))

    def stop(self) -> None:
        """Take nothing more, let what is queued leave for DRAIN_S, then end the loop. Idempotent."""
        if self._is_stopping:
            return
        self._is_stopping = True
        self._notice.send("STOPPING=1")
        until = self.loop.clock() + FINISH_S
        for inlet in self._inlets:
            inlet.finish(until)
        if self._neighbours is not None:
            self._neighbours.stop()
        self._drain(self.loop.clock() + DRAIN_S)

    def close(self) -> None:
        """Close everything, whatever state it is in: after stop() or in the middle of a failure."""
        for inlet in self._inlets:
            inlet.close()
        if self._neighbours is not None:
            self._neighbours.stop()
        for interface in self._interfaces:
            interface.interface.outlet.drop_all(Reason.STOPPED)
            interface.stop()
        self._control.close()
        self.router.flush()
        self.users.publisher.close()
        self._report_publisher.close()
        self._context.term()

    def ego(self) -> Ego:
        """Own state: the configured position, the system's clock.

        A box without a clock of its own starts in 1970: it routes all the same, and calls its position unknown,
        because a position vector without a time is none.
        """
        utc_s = time.time()
        if utc_s < EPOCH:
            return Ego(0, self._place, False)
        return Ego(its_time_ms(utc_s, leap_seconds(utc_s)), self._place, self._is_placed)

    def status(self) -> dict[str, object]:
        """The status object, its counters up to date."""
        self._refresh()
        publisher = self.users.publisher
        return {
            "station": self.config.tables.station.name,
            "profile": self.config.tables.station.profile,
            **process_status(self._started, self.loop.clock()),
            "is_clock_set": time.time() >= EPOCH,
            "interfaces": {entry.interface.name: entry.status() for entry in self._interfaces},
            "endpoint": {
                "requests": self.router.requests,
                "accepted": self.router.accepted,
                "published": self.users.published,
                "raw": self.users.raw,
                "slow_since": publisher.slow_since,
                "slow_count": publisher.slow_count,
            },
            "report": {
                "slow_since": self._report_publisher.slow_since,
                "slow_count": self._report_publisher.slow_count,
            },
            "drops": list(self.drops.status()),
            "duplicates": self.duplicates.status(),
            "policy": self.router.policy.status(),
        }

    def _refresh(self) -> None:
        """Bring the counters up to date, so that their sums match: what the users get, what the kernel dropped."""
        self.router.flush()
        for interface in self._interfaces:
            interface.refresh()

    def _open_endpoint(self, is_legacy: bool) -> None:
        loop, context, endpoint = self.loop, self._context, self.config.tables.endpoint
        host = f"[{endpoint.address}]" if ":" in endpoint.address else endpoint.address

        def at(port: int) -> str:
            return f"tcp://{host}:{port}"

        def done(act: Callable[[], None]) -> dict[str, object]:
            act()
            return {}

        local = self.ego if endpoint.local_info and not is_legacy else None
        self.users = Users(loop, context, at(endpoint.to_users), self.topics, self.drops, local)
        self._report_publisher = Publisher(
            loop, context, at(endpoint.report), "report", self.drops, (CONFIRM, STATUS), self._report_interest
        )
        self.report = Report(loop, self._report_publisher, self.status, self._refresh)
        self._inlets = [
            Inlet(
                loop,
                context,
                kind,
                at(port),
                name,
                self.topics,
                self.router,
                kind == zmq.PULL,
                endpoint.strict,
            )
            for kind, port, name in (
                (zmq.SUB, endpoint.from_users, "from_users"),
                (zmq.PULL, endpoint.pull, "pull"),
            )
        ]
        self._control = ControlSocket(
            loop,
            endpoint.control or default_path(endpoint.from_users),
            Commands(
                {
                    "status": lambda _: {"status": self.status()},
                    "reload": lambda _: done(self.reload_policy),
                    "stop": lambda _: done(self.stop),
                }
            ),
        )
        self.router.publish = self.users.publish
        self.router.report = self.report.confirm

    def _report_interest(self, topic: bytes, is_wanted: bool) -> None:
        if topic == CONFIRM:
            self.router.is_confirm_wanted = is_wanted
        else:
            self.report.status_interest(is_wanted)

    def _drivers(self) -> list[tuple[str, Driver, QueueOptions]]:
        reception, endpoint = self.config.tables.reception, self.config.tables.endpoint
        shared = Shared(
            self.config.mac,
            frozenset(reception.gn_versions),
            reception.unverified == "deliver",
            frozenset(self.topics.ports),
            self.topics.lanes(),
            self.config.tables.station.type,
            self.config.tables.station.is_mobile,
            bool(self.config.tables.station.mac),
        )
        drivers: list[tuple[str, Driver, QueueOptions]] = [
            (entry.name, DRIVERS[entry.queue.driver](entry.options, shared), entry.queue)
            for entry in self.config.interfaces
        ]
        if endpoint.ipc_in or endpoint.ipc_out:
            ipc = Ipc(self._context, IpcOptions(endpoint.ipc_in, endpoint.ipc_out), self.topics, self.drops)
            drivers.append(("ipc", ipc, QueueOptions("ipc")))
        return drivers

    def _supervised(self, name: str, driver: Driver, queue: QueueOptions) -> Supervised:
        interface = Interface(name, driver, queue, self.loop, self.router, self.topics, self.drops)
        if self.config.tables.reception.unknown_btp_port == "deliver":
            interface.accept_any_port()
        self.router.add(interface)
        return Supervised(self.loop, interface)

    def _drain(self, until: float) -> None:
        outlets = [interface.outlet for interface in self.router.interfaces.values()]
        if self.loop.clock() >= until or all(outlet.is_empty for outlet in outlets):
            self.loop.stop()
            return
        self.loop.after(DRAIN_STEP_S, lambda: self._drain(until))


def _place(config: Config) -> tuple[Position, bool]:
    place = config.tables.station.position
    if place is None:
        return Position(), False
    return Position(round(place.latitude * 1e7), round(place.longitude * 1e7)), True


def _changed_besides_policy(old: Config, new: Config) -> list[str]:
    return [
        f"[{name}]"
        for name in ("station", "endpoint", "reception", "interfaces", "types")
        if getattr(old.tables, name) != getattr(new.tables, name)
    ]
