"""The end of a process as a Source."""

import os
import select
import subprocess
from collections.abc import Callable


class Exit:
    """Calls when a process that was just started has ended. Raises OSError where that cannot be seen: it is killed.

    The process is reaped by whoever started it.
    """

    def __init__(self, process: subprocess.Popen[bytes], call: Callable[[], None]) -> None:
        self._call = call
        try:
            self._pidfd = os.pidfd_open(process.pid)
        except OSError:  # no descriptor is left
            process.kill()
            process.wait()
            raise

    def fileno(self) -> int:
        return self._pidfd

    def ready(self, events: int) -> None:
        self._call()

    def comes(self, within: float) -> bool:
        """Wait for it here, so many seconds at most."""
        return bool(select.select([self._pidfd], [], [], within)[0])

    def close(self) -> None:
        os.close(self._pidfd)
