"""Source of corrections: a file or a TCP server; passes on whole RTCM 3 frames."""

from typing import Protocol

from board.runtime.address import address
from drivers.contract import Host
from drivers.gnss.corrections.file import FileCorrections
from drivers.gnss.corrections.frames import Take
from drivers.gnss.corrections.tcp import TcpCorrections
from drivers.gnss.options import TCP


class Corrections(Protocol):
    """A started source of RTCM frames.

    Its errors never stop the interface, because a receiver works without corrections. They are shown in the details and
    the journal, and the source tries again.
    """

    def close(self) -> None:
        """Close the source; idempotent."""

    def details(self) -> dict[str, object]:
        """Return details of the source for status."""


def corrections(where: str, host: Host, take: Take) -> Corrections | None:
    """Create the source that the option `corrections` names; None if it is empty.

    take  called with each RTCM frame.

    The source opens its file or connection by itself, and again after each failure.
    """
    if not where:
        return None
    if where.startswith(TCP):
        return TcpCorrections(address(where.removeprefix(TCP)), host, take)
    return FileCorrections(where, host, take)
