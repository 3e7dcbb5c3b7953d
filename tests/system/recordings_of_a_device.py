"""Recordings of Ethernet devices: test_recordings.py runs this in a network namespace.

usage: python -m tests.system.recordings_of_a_device FOLDER
"""

import subprocess
import sys
from pathlib import Path
from tempfile import mkdtemp

from tests.system.conftest import Bench, Launcher
from tests.system.links import Device
from tests.system.recordings import addresses, are_the_same, endpoint_gives, indicated, recorded, replay, tshark_opens
from tests.system.station import toml_table


def main(folder: Path) -> None:
    subprocess.run(["ip", "link", "set", "lo", "up"], check=True)
    launch = Launcher(lambda: Path(mkdtemp(dir=folder)))
    try:
        (first, near), (second, far) = (station(launch, name) for name in ("near", "far"))
        found = recorded(first, {"g5": near}, folder)
        tshark_opens(found.files["pcapng"], made_up=())
        tshark_opens(found.files["ring"], made_up=())
        for form, path in found.files.items():
            replay(str(path), *far.way_in)
            received = [second.user.receive() for _ in found.all]
            if form == "mcap":  # MCAP has no frames
                assert indicated(received) == indicated(found.all)
            else:
                are_the_same(received, found.all)
            replay(str(path), *addresses(second.station))
            endpoint_gives(far, found.all)
    finally:
        launch.close()


def station(launch: Launcher, device: str) -> tuple[Bench, Device]:
    link = Device(device)
    launch.at_end(link.close)
    bench = launch(more=toml_table(f"interfaces.{device}", link.table), reception={"duplicate_window_s": 0.0})
    bench.user.join_receiving(link)
    return bench, link


if __name__ == "__main__":
    main(Path(sys.argv[1]))
