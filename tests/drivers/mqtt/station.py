"""Station's end of the channel to the MQTT process, which runs as a thread of the test."""

import select
import socket
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from threading import Thread
from typing import Any

from drivers.message import Ego, Position
from drivers.mqtt.client.process import serve
from drivers.mqtt.client.settings import MqttSettings
from drivers.reason import Reason
from drivers.wire.v2n import talk
from drivers.wire.v2n.message import ReceivedPdu
from firmware.lab.certificates import Pair
from tests.broker.certificates import Authority

PATIENCE = 10.0  # timeout in seconds, which only a failing test reaches
TYPES = ("cam", "denm", "")
CAM = bytes.fromhex("0202000005390001020304")
DENM = bytes.fromhex("0201000005390001020304")


def settings(url: str, **how: Any) -> MqttSettings:
    """Return settings with short timeouts, for a station named vm."""
    return MqttSettings(
        **{
            "url": url,
            "types": TYPES,
            "client_id": "vm",
            "host": "vm",
            "station": 1337,
            "uuid": "u",
            "plaintext": True,
            "first_delay_s": 0.05,
            "longest_delay_s": 0.2,
            "connect_s": 5.0,
            **how,
        }
    )


def secured(url: str, authority: Authority, identity: Pair | None = None, **how: Any) -> MqttSettings:
    """Return settings with short timeouts and TLS, for a station named vm."""
    shown = {"certificate": str(identity.certificate), "key": str(identity.key)} if identity else {}
    return settings(url, ca=str(authority.certificate), **shown, **how)


class Station:
    """Station that records the messages of the process by kind."""

    def __init__(self, wanted: MqttSettings) -> None:
        self.received: list[ReceivedPdu] = []
        self.moments_ns: list[int] = []  # times of these messages
        self.sent: dict[int, tuple[Reason | None, str]] = {}
        self.states: list[tuple[bool, str]] = []
        self.drops: dict[Reason, int] = {}
        self.samples: dict[Reason, bytes] = {}
        self.whys: dict[Reason, str] = {}
        self.details: list[dict[str, object]] = []
        self.faults: list[tuple[str, str]] = []
        self._near, far = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._near.send(wanted.message())
        self._thread = Thread(target=self._run, args=(far,), daemon=True)
        self._thread.start()

    def _run(self, far: socket.socket) -> None:
        with far:
            serve(far)

    @property
    def is_up(self) -> bool:
        return bool(self.states) and self.states[-1][0]

    @property
    def why(self) -> str:
        return self.states[-1][1] if self.states else ""

    def tell(self, message: bytes) -> None:
        self._near.send(message)

    def send(self, number: int = 1, pdu: bytes = CAM, btp_port: int = 2001, lifetime: float = 60.0) -> None:
        deadline = time.monotonic() + lifetime
        self.tell(talk.send(talk.ToSend(number, deadline, btp_port, TYPES.index("cam"), pdu)))

    def move(self, latitude: int, longitude: int) -> None:
        self.tell(talk.ego(Ego(722_130_000_000, Position(latitude, longitude), is_known=True)))

    def until(self, is_so: Callable[[], bool], within: float = PATIENCE) -> "Station":
        """Read messages until is_so() returns True. Fail after `within` seconds."""
        end = time.monotonic() + within
        while not is_so():
            left = end - time.monotonic()
            assert left > 0, f"not so within {within} s: {self.states[-3:]} {self.sent} {self.drops} {self.faults}"
            self.read(left)
        return self

    def up(self) -> "Station":
        return self.until(lambda: self.is_up)

    def down(self, *words: str) -> str:
        """Wait until the process reports that it is down, with these words in the reason."""
        self.until(lambda: bool(self.states) and not self.is_up and all(word in self.why for word in words))
        return self.why

    def read(self, within: float) -> None:
        """Read one message, if it arrives within a time in seconds."""
        if not select.select([self._near], [], [], within)[0]:
            return
        message = self._near.recv(65537)
        assert message, "the process has ended"
        match message[0]:
            case talk.RECEIVED:
                moment_ns, received = talk.parse_received(message)
                self.moments_ns.append(moment_ns)
                self.received.append(received)
            case talk.SENT:
                number, reason, why = talk.parse_sent(message)
                assert number not in self.sent, f"answered twice: {number}"
                self.sent[number] = (reason, why)
            case talk.STATE:
                self.states.append(talk.parse_state(message)[:2])
            case talk.DROPPED:
                reason, count, self.samples[reason], self.whys[reason] = talk.parse_dropped(message)
                self.drops[reason] = self.drops.get(reason, 0) + count
            case talk.DETAILS:
                self.details.append(talk.parse_details(message))
            case talk.FAULT:
                self.faults.append(talk.parse_fault(message))
            case talk.ALIVE:
                pass
            case other:
                raise AssertionError(f"what is {other}?")

    def close(self, is_killed: bool = False) -> None:
        """Close the station's side, with or without a message to the process, and wait until the process ends."""
        if not is_killed:
            with suppress(OSError):  # it has ended
                self._near.send(talk.LEAVE_NOW)
        self._near.close()
        self._thread.join(PATIENCE)
        assert not self._thread.is_alive(), "the process stays"


def written(path: Path, text: str, mode: int = 0o600) -> str:
    """Write a file and return its path."""
    path.write_text(text)
    path.chmod(mode)
    return str(path)
