"""In the guest: each pulse of /dev/pps0 as pps/device.py has it, a line of JSON each."""

import json
import sys
from pathlib import Path

from board.runtime.errors import InterfaceError
from board.runtime.loop import Loop
from pps.device import PulseDevice
from pps.pulse import Pulse


class Lines:
    """What the source tells, as it comes: pps.pulse.Above."""

    def pulse(self, pulse: Pulse) -> None:
        print(json.dumps({"pulse": pulse}), flush=True)

    def missed(self, count: int) -> None:
        print(json.dumps({"missed": count}), flush=True)

    def failed(self, error: InterfaceError) -> None:
        print(json.dumps({"failed": str(error)}), flush=True)


if __name__ == "__main__":
    loop = Loop()
    PulseDevice(loop, Path(sys.argv[1]), Lines()).start()
    print(json.dumps({"ready": sys.argv[1]}), flush=True)
    loop.run()
