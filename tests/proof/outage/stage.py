"""A station's way out over MQTT in virtual time: router, queue, driver and session are real, kernel and broker played."""

import base64
import json
import random
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import pytest

from board.runtime import worker
from drivers.contract import Shared
from drivers.message import Confirm, Outcome
from drivers.mqtt.client.settings import STALL_S
from drivers.mqtt.driver import Mqtt
from drivers.mqtt.options import MqttOptions
from drivers.reason import Reason
from drivers.wire.v2n.profile import Publication
from firmware.config.tables import QueueOptions
from firmware.routing.drops import Drops
from firmware.routing.interface import Interface
from firmware.routing.options import Parsed, RequestOptions
from firmware.routing.router import Router
from firmware.station.interface_supervisor import InterfaceSupervisor
from firmware.topics import Topics
from tests.drivers.host import EGO, MAC
from tests.proof.chaos.processes import PlayedChild
from tests.proof.outage import messages, road
from tests.proof.outage.account import Account
from tests.proof.outage.broker import Broker
from tests.proof.outage.client import PlayedMqtt, played
from tests.proof.outage.network import FLIGHT_S, HEADER, SLOW_DELAY_S, WRITABLE, Network
from tests.proof.outage.pattern import RATES_BIT_S, Kind, Trouble
from tests.proof.outage.road import Followed
from tests.proof.outage.watch import Watch
from tests.virtual import VirtualLoop

# Nothing leaves after its deadline. What has left at that may be with the kernel, which tries for STALL_S, or behind all
# that it takes of others in the slowest network; and then there is the way itself.
MESSAGE = 190  # octets of a CAM with topic, TLS, TCP and IP: the smaller, the more of them is TCP's
HELD = (WRITABLE + MESSAGE) * MESSAGE / (MESSAGE - HEADER)
TRANSIT_S = max(STALL_S, 8 * HELD / min(RATES_BIT_S)) + FLIGHT_S + SLOW_DELAY_S  # 3.75
WORD_S = 1.0  # the queue looks every 0.2 s, and counts its own pauses

URL = "mqtts://broker.example:8883"
BEARER = "modem"
TILED = "orange"

# What a modem says of its bearer; a tunnel it knows nothing of.
TOLD = frozenset({Kind.HANDOVER, Kind.LOSS, Kind.ABSENCE})


class Route(NamedTuple):
    """An interface to be: has_bearer, it follows its bearer; is_kept, the broker keeps its session."""

    name: str
    qos: int = 1
    has_bearer: bool = False
    profile: str = "vcaptain"
    is_kept: bool = False


class Path:
    """What one interface has to the broker."""

    def __init__(self, stage: "Stage", route: Route) -> None:
        name, qos, has_bearer, self.profile, self.is_kept = route
        self.watch = Watch()
        self.account = Account(name, TRANSIT_S, WORD_S, self.watch.was_usable, is_lossy=qos == 0)
        self.asked = Parsed(RequestOptions(interfaces=(name,)), None)
        options = MqttOptions(
            url=URL, client_id=name, host=name, qos=qos, bearer=BEARER if has_bearer else "", profile=self.profile,
            clean=not self.is_kept,
        )  # fmt: skip
        self.driver = Mqtt(options, stage.shared)
        self.kept = stage.broker.kept[name]
        self.followed = Followed(self.kept.filters, self.watch.was_usable) if self.profile == TILED else None
        self.interface = Interface(
            name, self.driver, QueueOptions("mqtt"), stage.loop, stage.router, stage.topics, stage.drops
        )
        self.supervised = InterfaceSupervisor(stage.loop, self.interface, stage.chance.random)
        stage.router.add(self.interface)


class Stage:
    """Paths to one broker over one network; none is up yet."""

    def __init__(self, patch: pytest.MonkeyPatch, seed: int, routes: Iterable[Route]) -> None:
        self.chance = random.Random(f"stage {seed}")
        self.loop = VirtualLoop()
        self.network = Network(self.loop)
        self.broker = Broker(self.loop, self.network, self._left, self._arrived)
        patch.setattr(worker, "Child", PlayedChild)
        patch.setitem(PlayedChild.programs, "mqtt", played(self.broker, self.chance.random))
        patch.setattr(worker, "jitter", self.chance.random)
        patch.setattr(PlayedChild, "running", [])
        self.topics = Topics()
        self.drops = Drops()
        kinds = tuple(kind.name for kind in self.topics.kinds)
        ports = frozenset(self.topics.ports)
        self.shared = Shared(mac=MAC, btp_ports=ports, lanes=self.topics.lanes(), types=kinds)
        self.router = Router(self.loop, self.topics, self.drops, lambda: road.ego(self.loop.now), lambda: EGO.its_ms)
        self.router.set_listeners([], [self])
        self.requests = 0
        self.refused = 0
        self.paths = {route.name: Path(self, route) for route in routes}

    def start(self) -> None:
        """Until all are up."""
        for path in self.paths.values():
            path.supervised.start()
            if path.driver.bearer:
                path.driver.bearer_changed("up", "wwan0", "up")
        self.loop.run_until(lambda: all(path.interface.is_up for path in self.paths.values()), 10.0)

    def stop(self) -> None:
        for path in self.paths.values():
            path.supervised.stop()
        self.loop.run_for(2.0)
        self.loop.close()

    def begin(self, trouble: Trouble) -> None:
        self.network.begin(trouble)
        for path in self.paths.values():
            path.watch.begin(self.loop.now)
            if path.driver.bearer and trouble.kind in TOLD:
                path.driver.bearer_changed("down", "", trouble.kind.value)

    def end(self, trouble: Trouble) -> None:
        self.network.end(trouble)
        for path in self.paths.values():
            path.watch.end(trouble, self.loop.now)
            if path.driver.bearer and trouble.kind in TOLD:
                path.driver.bearer_changed("up", "wwan0", "up")

    def request(self, envelope: bytes, pdu: bytes) -> None:
        """By each path for itself: one whose link is down is not passed over for those that are up."""
        self.requests += 1
        for path in self.paths.values():
            self.router.request(self.topics.by_envelope[envelope], pdu, "test", path.asked)

    @property
    def programs(self) -> list[PlayedMqtt]:
        return [child._program for child in PlayedChild.running if isinstance(child._program, PlayedMqtt)]

    def held(self) -> dict[str, int]:
        """What must not become more: entries of everything that keeps messages or timers."""
        windows = [program.session._window for program in self.programs if program.session is not None]
        return {
            "queues": sum(path.interface.outlet.length for path in self.paths.values()),
            "kept": sum(len(one.kept) for path in self.paths.values() if (one := path.driver._uplink) is not None),
            "windows": sum(len(one._requests) + len(one._waiting) + len(one._out) for one in windows),
            "timers": sum(timer.is_pending for _, _, timer in self.loop._timers),
            "children": len(PlayedChild.running),
        }

    def confirm(self, confirm: Confirm, targets: Sequence[Interface]) -> None:
        request, now = confirm.request, self.loop.clock()
        number = messages.number_of(request.pdu)
        if confirm.outcome is Outcome.ACCEPTED:
            for target in targets:
                account, need_s = self.paths[target.name].account, messages.need_s(request.pdu)
                account.request(number, request.accepted, request.deadline, need_s)
        elif confirm.outcome is Outcome.REFUSED:
            self.refused += 1
        else:
            path = self.paths[confirm.interface]
            path.account.said(number, confirm.reason, now, self._is_full(path, confirm.reason))
            if confirm.outcome is Outcome.SENT and not path.account.is_lossy:
                path.watch.through(now, request.accepted)

    def _is_full(self, path: Path, reason: Reason | None) -> bool:
        outlet = path.interface.outlet
        return reason is not Reason.QUEUE_FULL or outlet.length >= outlet.capacity

    def look(self) -> None:
        """Whether all are subscribed to what is around the vehicle."""
        own, now = road.ego(self.loop.now), self.loop.now
        for path in self.paths.values():
            if path.followed is not None:
                path.followed.look(own, path.watch.is_troubled, now)

    def _left(self, client: str, connection: int, publication: Publication) -> None:
        number = _number(client, publication.payload)
        if number is not None:
            self.paths[client].account.left(number, connection, self.loop.now)

    def _arrived(self, client: str, publication: Publication) -> None:
        number = _number(client, publication.payload)
        if number is not None:
            path, now = self.paths[client], self.loop.now
            path.account.arrived(number, now)
            if path.account.is_lossy:
                path.watch.through(now, path.account.accepted(number))


def _number(client: str, payload: bytes) -> int | None:
    """Return that of the message in a publication; None where it is about the status."""
    if payload.startswith(b"{"):
        message = json.loads(payload)["message"]
        return int(message["station_id"]) if "station_id" in message else _number_in(message["payload"])
    host, _, rest = payload.decode().partition("(")
    assert not rest or host == client
    return _number_in(rest.partition("<")[2].partition(">")[0]) if rest else None


def _number_in(coded: str) -> int:
    return messages.number_of(base64.b64decode(coded, validate=True))
