"""The station's sockets: four ports for users, and the Unix socket of the command line."""

import os
from collections.abc import Callable
from typing import TYPE_CHECKING

import zmq

from board.errors import StationError
from board.loop import Loop
from drivers.contract import Witness
from drivers.message import Ego
from firmware.control_socket import ControlSocket, default_path
from firmware.drops import Drops
from firmware.inlet import Inlet
from firmware.peers.guard import Guard
from firmware.publisher import Publisher
from firmware.question import Commands
from firmware.report import CONFIRM, FRAME, IMPLAUSIBLE, INDICATION, SOON, STATUS, TIME, TOPICS, Report
from firmware.router import Router
from firmware.tables import EndpointOptions
from firmware.topics import Topics
from firmware.users import Users

if TYPE_CHECKING:
    from firmware.frames import Frames

# What users have handed over is taken for FINISH_S when the station stops.
FINISH_S = 0.2


class Endpoint:
    """All of them, opened at once.

    local     own position for localInfo; None leaves it out.
    status    makes the status object, time_status its part about time; refresh brings the counters in it up to date.
    commands  of the control socket.
    mac       the station's own address.
    witness   where interfaces find who looks at their frames.
    has_recorder  whether the report port has a private address, too: private_report.

    Raises StationError when one cannot be had, and has then closed the others.
    """

    def __init__(
        self,
        loop: Loop,
        options: EndpointOptions,
        topics: Topics,
        drops: Drops,
        router: Router,
        local: Callable[[], Ego] | None,
        status: Callable[[], dict[str, object]],
        refresh: Callable[[], None],
        time_status: Callable[[], dict[str, object]],
        commands: Commands,
        mac: bytes,
        witness: Witness,
        has_recorder: bool = False,
    ) -> None:
        self.context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        self._loop = loop
        self._router = router
        self._drops = drops
        self._mac = mac
        self._witness = witness
        self._wanted: set[bytes] = set()  # topics of the report port
        self._frames: Frames | None = None
        self._are_frames_shown = False
        self.private_report = f"ipc://@captain-{os.urandom(8).hex()}" if has_recorder else ""
        host = f"[{options.address}]" if ":" in options.address else options.address

        def at(port: int) -> str:
            return f"tcp://{host}:{port}"

        try:
            self.users = Users(loop, self.context, at(options.to_users), topics, drops, local)
            self._reports = Publisher(
                loop,
                self.context,
                at(options.report),
                "report",
                drops,
                TOPICS,
                self._interest,
                costly=(IMPLAUSIBLE, FRAME, SOON),
                also=[self.private_report] if has_recorder else [],
            )
            self.report = Report(loop, self._reports, status, refresh, time_status, router.quality_now)
            self.inlets = [
                Inlet(loop, self.context, kind, at(port), name, topics, router, drops, kind == zmq.PULL, options.strict)
                for kind, port, name in (
                    (zmq.SUB, options.from_users, "from_users"),
                    (zmq.PULL, options.pull, "pull"),
                )
            ]
            self._control = ControlSocket(loop, options.control or default_path(options.from_users), commands)
        except StationError:
            self.context.destroy(linger=0)  # those sockets that could be had
            raise
        self._guard = Guard(loop, self.inlets, (self.users.publisher, self._reports))
        router.publish = self.users.publish

    def start(self) -> None:
        self.users.start()
        self.report.start()

    def finish(self) -> None:
        """Take what users have handed over, and nothing after it."""
        until = self._loop.clock() + FINISH_S
        for inlet in self.inlets:
            inlet.finish(until)

    def close_inlets(self) -> None:
        for inlet in self.inlets:
            inlet.close()

    def tell(self) -> None:
        """Tell what still waits."""
        self.report.finish()
        if self._frames is not None:
            self._frames.finish()

    def close(self) -> None:
        """Close what is left; messages on their way out have libzmq's time to leave."""
        self.tell()
        self._control.close()
        self.users.publisher.close()
        self._reports.close()
        self._guard.close()
        self.context.term()

    def status(self) -> dict[str, object]:
        """The parts of the status that are about users and reports."""
        publisher = self.users.publisher
        return {
            "endpoint": {
                "requests": self._router.requests,
                "accepted": self._router.accepted,
                "published": self.users.published,
                "raw": self.users.raw,
                "slow_since": publisher.slow_since,
                "slow_count": publisher.slow_count,
                "connections": self._guard.status(),
            },
            "report": {
                "slow_since": self._reports.slow_since,
                "slow_count": self._reports.slow_count,
                "confirms": self.report.confirms,
                "indications": self.report.indications,
                "frames": {} if self._frames is None else self._frames.totals(),
            },
        }

    def _interest(self, topic: bytes, is_wanted: bool) -> None:
        """Somebody subscribed to a topic of the report port, or the last one left."""
        was_wanted = topic in self._wanted
        (self._wanted.add if is_wanted else self._wanted.discard)(topic)
        if topic == STATUS:
            self.report.status_interest(is_wanted)
        elif topic == TIME:
            self.report.time_interest(is_wanted)
        elif topic == SOON:
            self.report.is_hurried = is_wanted
        elif topic == FRAME:
            if is_wanted is not was_wanted:
                self._look_at_frames(is_wanted)
        else:
            self._look_at_messages()

    def _look_at_frames(self, is_wanted: bool) -> None:
        if self._frames is None:
            from firmware.frames import Frames  # few stations have somebody who wants them

            publish = self._reports.publish_both
            self._frames = Frames(
                self._loop,
                publish,
                self._router,
                self._mac,
                self._drops,
                self._show_frames,
                is_counting=bool(self.private_report),
            )
        (self._frames.resume if is_wanted else self._frames.forget)()
        self._drops.watch = self._frames.drop if is_wanted else None
        self._show_frames(is_wanted)

    def _show_frames(self, is_wanted: bool) -> None:
        self._are_frames_shown = is_wanted
        self._witness.watch = self._frames if is_wanted else None
        self._look_at_messages()

    def _look_at_messages(self) -> None:
        """What is known of messages goes to those who have asked, and costs nothing where nobody has."""
        router, report, wanted = self._router, self.report, self._wanted
        confirms = [report.confirm] if CONFIRM in wanted else []
        indications = [report.observe] if INDICATION in wanted else []
        if IMPLAUSIBLE in wanted:
            indications.append(report.observe_implausible)
        if self._frames is not None and self._are_frames_shown:
            confirms.append(self._frames.confirm)
            indications.append(self._frames.observe)
        router.is_confirm_wanted = bool(confirms)
        router.report = confirms[0] if len(confirms) == 1 else lambda *told: _each(confirms, *told)
        if not indications:
            router.observe = None
        else:
            router.observe = indications[0] if len(indications) == 1 else lambda *told: _each(indications, *told)


def _each(calls: list[Callable[..., None]], *told: object) -> None:
    for call in calls:
        call(*told)
