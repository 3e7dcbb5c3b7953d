"""Python client while the station is restarted: each request has one outcome, and missed messages are counted exactly.

usage: python -m tests.proof.client [--duration S] [--restarts N] [--rate R]; make client ARGS='--duration 8 --restarts 2'

A program sends by the client, and a far end of the interface sends to it, at --rate messages per second each. Blocking and
asyncio form take --duration seconds each.
"""

import argparse
import json
import select
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager, suppress
from pathlib import Path
from typing import Any

from tests.proof.client.user import END, READY
from tests.system.air import Air
from tests.system.conftest import Launcher
from tests.system.station import ROOT, Station

FORMS = {"blocking": ("blocking-send", "blocking-listen"), "asyncio": ("asyncio",)}
QUIET_S = 0.1  # without messages before a restart
TICK_S = 0.002
LOST = 200  # most messages that a restart may cost each way: the open requests, and those until the reconnection
ANSWER_S = 30.0  # timeout until a program is ready or has ended
CAM, DENM = 2, 1  # messageIDs


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--duration", type=float, default=60.0)
    parser.add_argument("--restarts", type=int, default=10)
    parser.add_argument("--rate", type=float, default=200.0)
    asked = parser.parse_args()
    verdicts = []
    for form in FORMS:
        with (
            tempfile.TemporaryDirectory() as folder,
            closing(Launcher(lambda folder=folder: Path(tempfile.mkdtemp(dir=folder)))) as launch,
        ):
            verdicts.append(Proof(launch, form, asked.rate).run(round(asked.duration * asked.rate), asked.restarts))
    return 0 if all(verdicts) else 1


class Proof:
    """Station with one interface, its far end, and programs with one form of the client."""

    def __init__(self, launch: Launcher, form: str, rate: float) -> None:
        self._form, self._rate = form, rate
        self._air: Air = launch.air("pdu")
        self._air.socket.setblocking(False)
        self._station: Station = launch.station()
        place = {"latitude": 48.7668, "longitude": 11.4321}
        self._station.configure({"g5": self._air.table}, station={"position": place})
        self._station.start()
        self._heard: Counter[int] = Counter()  # CAMs on the link, by stationID

    def run(self, count: int, restarts: int) -> bool:
        """Send `count` messages each way, with restarts between. Print the sums; return True if they are exact."""
        delivered = 0
        with ExitStack() as stack:
            users = [stack.enter_context(self._user(name, count)) for name in FORMS[self._form]]
            for user in users:
                self._until_ready(user)
            for number in range(restarts + 1):
                self._send(count * number // (restarts + 1), count * (number + 1) // (restarts + 1))
                self._rest(QUIET_S)
                status = self._station.status()
                denms = status["interfaces"]["g5"]["received"].get("denm", 0)
                delivered += status["endpoint"]["published"] - denms
                if number < restarts:
                    self._station.stop()
                    self._station.start()
            said = [self._ended(user) for user in users]
        self._rest(QUIET_S)
        outcomes = {int(number): outcome for one in said for number, outcome in one["outcomes"].items()}
        received = [number for one in said for number in one["received"]]
        missed = sum(one["missed"] for one in said)
        print(
            f"{self._form}: {count} messages each way at {self._rate:g}/s, {restarts} restarts; {Counter(outcomes.values())}"
        )
        least = count - restarts * LOST
        return self._is_exact(count, least, outcomes) & _are_exact(received, missed, delivered, least)

    def _is_exact(self, count: int, least: int, outcomes: dict[int, str]) -> bool:
        """Print the figures of requests beside their goals. Return True if all are met."""
        confirmed = {number for number, outcome in outcomes.items() if outcome == "confirmed"}
        raised = len(outcomes) - len(confirmed)
        once = sum(self._heard[number] == 1 for number in confirmed)
        most = max(self._heard.values(), default=0)
        print(f"  confirmed {len(confirmed)} + raised {raised} = {len(outcomes)}; goal: {count}, the requests")
        print(f"  confirmed {len(confirmed)}; goal: at least {least}")
        print(f"  confirmed ones that were on the link exactly once: {once}; goal: {len(confirmed)}")
        print(f"  times that the same message was on the link: {most}; goal: at most 1")
        return len(outcomes) == count and len(confirmed) >= least and once == len(confirmed) and most <= 1

    @contextmanager
    def _user(self, name: str, count: int) -> Iterator["subprocess.Popen[str]"]:
        address = f":{self._station.ports['from_users']}"
        command = [sys.executable, "-m", "tests.proof.client.user", name, address, str(count), str(self._rate)]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT) as child:
            try:
                yield child
            finally:
                child.kill()

    def _until_ready(self, user: "subprocess.Popen[str]") -> None:
        """Send DENMs until a program has subscribed."""
        assert user.stdout is not None
        end = time.monotonic() + ANSWER_S
        while not select.select([user.stdout], [], [], TICK_S)[0]:
            assert time.monotonic() < end, "a program did not become ready"
            self._throw(DENM, READY)
        assert user.stdout.readline() == "ready\n"

    def _ended(self, user: "subprocess.Popen[str]") -> dict[str, Any]:
        """Send DENMs that end a program until it has ended. Return what it printed."""
        end = time.monotonic() + ANSWER_S
        while time.monotonic() < end:
            self._throw(DENM, END)
            self._hear()
            try:
                said, _ = user.communicate(timeout=TICK_S)
            except subprocess.TimeoutExpired:
                continue
            found: dict[str, Any] = json.loads(said)
            return found
        raise AssertionError("a program did not end")

    def _send(self, first: int, last: int) -> None:
        """Send CAMs of the stationIDs first + 1 to last at the rate, and hear meanwhile."""
        start = time.monotonic()
        for number in range(first, last):
            while time.monotonic() < start + (number - first) / self._rate:
                self._hear()
                time.sleep(TICK_S)
            self._throw(CAM, number + 1)

    def _rest(self, pause_s: float) -> None:
        end = time.monotonic() + pause_s
        while time.monotonic() < end:
            self._hear()
            time.sleep(TICK_S)

    def _throw(self, message_id: int, station: int) -> None:
        self._air.send(bytes((2, message_id)) + station.to_bytes(4, "big"))

    def _hear(self) -> None:
        """Count the CAMs that have arrived from the station."""
        with suppress(BlockingIOError):
            while True:
                octets = self._air.hear().pdu
                if octets[1] == CAM:
                    self._heard[int.from_bytes(octets[2:6], "big")] += 1


def _are_exact(received: list[int], missed: int, delivered: int, least: int) -> bool:
    """Print the figures of received messages beside their goals. Return True if all are met."""
    different = len(set(received))
    print(
        f"  received {len(received)} + missed {missed} = {len(received) + missed}; goal: {delivered}, as delivered by the station"
    )
    print(f"  received {len(received)}; goal: at least {least}")
    print(f"  different ones of them: {different}; goal: {len(received)}")
    return len(received) + missed == delivered and different == len(received) >= least


if __name__ == "__main__":
    sys.exit(main())
