"""End of a process as a Source."""

import os
import select
import subprocess
from collections.abc import Callable


class Exit:
    """Calls when a started process ends. Raises OSError without a free descriptor, after killing the process.

    The caller reaps the process.
    """

    def __init__(self, process: subprocess.Popen[bytes], call: Callable[[], None]) -> None:
        self._call = call
        try:
            self._pidfd = os.pidfd_open(process.pid)
        except OSError:  # no descriptor is free
            process.kill()
            process.wait()
            raise

    def fileno(self) -> int:
        return self._pidfd

    def ready(self, events: int) -> None:
        self._call()

    def comes(self, within: float) -> bool:
        """Wait for the end, at most `within` seconds; return whether the process has ended."""
        return bool(select.select([self._pidfd], [], [], within)[0])

    def close(self) -> None:
        os.close(self._pidfd)
