"""Requests in JSON while the facilities process is killed: each has one outcome, and leaves once or never.

usage: python -m tests.proof.facilities [--requests N] [--kills K] [--seed S]; make facilities ARGS='--requests 200 --kills 3'
"""

import argparse
import json
import os
import random
import signal
import sys
import tempfile
import time
from collections import Counter
from contextlib import closing
from pathlib import Path

import captain_messages as messages

from tests.system.conftest import Bench, Launcher

RATE = 40.0  # requests per second: the kills then meet requests, and the process is up again for most of them
LEAST_SENT = 0.9
SPEED = "cam.camParameters.highFrequencyContainer.basicVehicleContainerHighFrequency.speed.speedValue"
POSITION = {"latitude": 48.7668, "longitude": 11.4321}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--requests", type=int, default=1000)
    parser.add_argument("--kills", type=int, default=10)
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    with (
        tempfile.TemporaryDirectory() as folder,
        closing(Launcher(lambda: Path(tempfile.mkdtemp(dir=folder)))) as launch,
    ):
        bench = launch(station={"position": POSITION})
        return _measure(bench, asked.requests, asked.kills, random.Random(asked.seed))


def _measure(bench: Bench, count: int, kills: int, chance: random.Random) -> int:
    reports = bench.make_reports()
    at = sorted(chance.sample(range(1, count), kills))
    outcomes: Counter[str] = Counter()
    by_label: dict[str, str] = {}
    due = time.monotonic()
    for number in range(count):
        while (left := due - time.monotonic()) > 0:
            time.sleep(left)
        due += 1 / RATE
        bench.user.push_pdu(b"v2x.cam.", _cam(number), label=str(number), form="json")
        if number in at:
            _kill(bench)
    while len(by_label) < count:
        confirm = reports.next()[1]
        if confirm["outcome"] != "accepted" and confirm["label"].isdecimal():
            assert confirm["label"] not in by_label, f"a second outcome: {confirm}"
            by_label[confirm["label"]] = confirm["reason"] or confirm["outcome"]
    outcomes.update(by_label.values())
    sent = [label for label, outcome in by_label.items() if outcome == "sent"]
    read = messages.find("cam-1.4.1").reader(SPEED)
    heard = Counter(str(read(bench.air.hear().pdu)[0]) for _ in sent)
    bench.air.socket.settimeout(0.5)
    more = 0
    try:
        while bench.air.hear():
            more += 1
    except TimeoutError:
        pass
    restarts = bench.station.status()["facilities"]["restarts"]
    print(
        f"requests {count}, outcomes {len(by_label)}: {dict(outcomes)}; process killed {kills} times, {restarts} restarts"
    )
    is_exact = heard == Counter(sent) and not more
    print(f"on the link: {sum(heard.values()) + more} messages, each sent one exactly once: {is_exact}; goal: true")
    print(f"sent: {len(sent)}; goal: at least {LEAST_SENT * count:.0f}")
    return 0 if is_exact and len(sent) >= LEAST_SENT * count and restarts == kills else 1


def _cam(number: int) -> bytes:
    container = {"driveDirection": "forward", "speed": {"speedValue": number}}
    parameters = {
        "basicContainer": {"stationType": 5},
        "highFrequencyContainer": {"basicVehicleContainerHighFrequency": container},
    }
    return json.dumps({"edition": "cam-1.4.1", "message": {"cam": {"camParameters": parameters}}}).encode()


def _kill(bench: Bench) -> None:
    """Kill the process, if it runs just now; else as soon as it does."""
    why = bench.station.until(lambda status: status.get("facilities", {}).get("is_running", False))["facilities"]["why"]
    os.kill(int(why.split()[1]), signal.SIGKILL)


if __name__ == "__main__":
    sys.exit(main())
