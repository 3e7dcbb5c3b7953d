"""Where corrections come from: a file, or a TCP server. Only whole RTCM 3 frames are passed on."""

from typing import Protocol

from board.address import address
from drivers.contract import Host
from drivers.gnss_options import TCP
from drivers.gnss_rtcm import Take
from drivers.gnss_rtcm_file import FileCorrections
from drivers.gnss_rtcm_tcp import TcpCorrections


class Corrections(Protocol):
    """A source of RTCM frames that was started.

    It never fails: a receiver without corrections still knows where it is. What is wrong is in the details and in the
    journal, and it is tried again.
    """

    def close(self) -> None:
        """Idempotent."""

    def details(self) -> dict[str, object]:
        """What status shows of it."""


def corrections(where: str, host: Host, take: Take) -> Corrections | None:
    """Open what the option says, now or later."""
    if not where:
        return None
    if where.startswith(TCP):
        return TcpCorrections(address(where.removeprefix(TCP)), host, take)
    return FileCorrections(where, host, take)
