"""Messages through a started station by each of its interfaces, and what comes out behind the broker."""

import base64
import json
import queue
import time
from collections.abc import Callable, Iterator

import zmq

from drivers.reason import Reason
from firmware.topics import Topics
from tests.broker.client import Client
from tests.proof.outage import messages
from tests.proof.outage.account import Account
from tests.proof.outage.messages import Schedule
from tests.proof.outage.watch import Watch
from tests.system.station import Station

JOIN_S = 5.0
POLL_S = 0.01  # how late an arrival may be noticed


class Traffic:
    """A user of the station, and an observer at the broker.

    accounts, watches  by interface, which is the name of the client as well.
    """

    def __init__(self, station: Station, observer: Client, schedule: Schedule, accounts: dict[str, Account]) -> None:
        self.accounts = accounts
        self.watches = {name: Watch() for name in accounts}
        self.requests = 0
        self.accepted = 0
        self.refused: list[str] = []
        self._observer = observer
        self._schedule = schedule
        self._lifetimes = {envelope: kind.lifetime for envelope, kind in Topics().by_envelope.items()}
        self._context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        self._push = self._socket(zmq.PUSH, station.address("pull"))
        self._report = self._socket(zmq.SUB, station.address("report"))
        self._report.subscribe(b"confirm.")

    def join(self) -> None:
        """Until a message each way has passed; what was sent for this does not count."""
        end = time.monotonic() + JOIN_S
        name = next(iter(self.accounts))
        while not self._report.poll(50):
            if time.monotonic() > end:
                raise RuntimeError("no confirm comes")
            self._push.send_multipart([b"v2x.join", b"", json.dumps({"interfaces": [name]}).encode()])
        while self._report.poll(300):
            self._report.recv_multipart()

    def send(self) -> None:
        """What is due at this tick, by each interface for itself."""
        for envelope, count in self._schedule.due():
            for _ in range(count):
                self.requests += 1
                self._request(envelope, self.requests)

    def listen(self, seconds: float) -> None:
        """Take what comes for so long."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            self._report.poll(1000 * min(left, POLL_S))
            self.take()

    def take(self) -> None:
        """What has come. What arrived was there before its confirm: it is looked at first."""
        for payload in _all(lambda: self._observer.messages.get_nowait().payload, queue.Empty):
            self._arrived(payload.decode(), time.monotonic())
        for octets in _all(lambda: self._report.recv_multipart(zmq.NOBLOCK)[1], zmq.Again):
            self._confirmed(json.loads(octets), time.monotonic())

    def close(self) -> None:
        self._context.destroy(linger=0)

    def _request(self, envelope: bytes, number: int) -> None:
        octets = messages.pdu(envelope, number)
        for name, account in self.accounts.items():
            asked = json.dumps({"label": str(number), "interfaces": [name]}).encode()
            now = time.monotonic()
            account.request(number, now, now + self._lifetimes[envelope], messages.NEED_S[envelope])
            self._push.send_multipart([envelope, octets, asked])

    def _arrived(self, payload: str, now: float) -> None:
        host, _, rest = payload.partition("(")
        if rest and host in self.accounts:
            pdu = base64.b64decode(rest.partition("<")[2].partition(">")[0], validate=True)
            account, number = self.accounts[host], messages.number_of(pdu)
            account.arrived(number, now)
            if account.is_lossy:
                self.watches[host].through(now, account.accepted(number))

    def _confirmed(self, told: dict[str, str], now: float) -> None:
        outcome, name, reason = told["outcome"], told["interface"], told["reason"]
        if outcome == "accepted":
            self.accepted += 1
        elif outcome == "refused":
            self.refused.append(f"{told['label']}: {reason}")
        else:
            account, number = self.accounts[name], int(told["label"])
            account.said(number, Reason(reason) if reason else None, now)
            if not reason and not account.is_lossy:
                self.watches[name].through(now, account.accepted(number))

    def _socket(self, kind: int, address: str) -> "zmq.Socket[bytes]":
        made = self._context.socket(kind)
        made.linger = 0
        made.rcvhwm = made.sndhwm = 0
        made.connect(address)
        return made


def _all(take: Callable[[], bytes], nothing: type[Exception]) -> Iterator[bytes]:
    while True:
        try:
            yield take()
        except nothing:
            return
