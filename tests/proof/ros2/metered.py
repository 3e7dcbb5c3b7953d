"""The link meter beside the gateways: what it measures between their stations is what ROS has counted."""

import json
import signal
import subprocess
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from firmware.meter.report.page import paths
from tests.proof.ros2.rows import Row
from tests.system.station import ENDPOINTS, PROGRAM, Station

WAIT_S = 60.0


@contextmanager
def metered(stations: Mapping[str, Station], page: Path) -> Iterator[dict[str, Any]]:
    """Measures meanwhile; the result is there afterwards, and in a page."""
    for old in paths(page):
        old.unlink(missing_ok=True)
    command = [*PROGRAM, "meter", "--json", "--report", str(page)]
    for name, station in stations.items():
        ports = ",".join(str(station.ports[end]) for end in ENDPOINTS)
        command += ["--at", f"{name}=127.0.0.1:{ports}"]
    told: dict[str, Any] = {}
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            assert process.stderr is not None
            said = process.stderr.readline()
            assert "heard" in said, said
            yield told
            process.send_signal(signal.SIGTERM)
            told |= json.loads(process.communicate(timeout=WAIT_S)[0])
        finally:
            process.kill()


def measured(told: Mapping[str, Any], sent: int) -> Row:
    """What it has measured, beside what was sent by ROS."""
    sums = {key: sum(way[key] for way in told["ways"]) for key in ("sent", "arrived", "lost", "unseen")}
    delays = ", ".join(f"{way['one_way_us']['median'] / 1000:.2f} ms" for way in told["ways"] if way["one_way_us"])
    found = f"{sums['sent']} sent, {sums['arrived']} arrived, {sums['lost']} lost; median delays {delays}"
    is_right = (sums["sent"], sums["arrived"], sums["lost"]) == (sent, sent, 0)
    return Row("by captain meter, between the stations", found, "" if is_right else f"{sent} to be sent, all to arrive")
