"""Simulated network of a modem: the coverage, and the modem's registration."""

from collections.abc import Callable
from enum import IntEnum
from typing import NamedTuple

from board.runtime.loop import Loop, Timer

SEARCH_S = 3.0  # seconds until an LTE cell is found
STEP_S = 2.0  # seconds from LTE to NSA, and from NSA to SA

OPERATOR = "CHN-CT"  # matches the cells below: MCC 460, MNC 11
ADDRESS = "10.64.1.2"


class Access(IntEnum):
    """Access that a modem is camped on, in the order of its search."""

    NONE = 0
    SEARCHING = 1
    LTE = 2
    NSA = 3
    SA = 4


class Air(NamedTuple):
    """Captured lines of a modem for an access.

    cell      lines of AT+CPSI?.
    signal    value of AT+CSQ; 99 in 5G SA.
    operator  <AcT> of AT+COPS?.
    """

    cell: tuple[str, ...]
    signal: str
    operator: int = 7


_LTE = "+CPSI: LTE,Online,460-11,0x5A1E,187214780,257,EUTRAN-BAND3,1850,5,5,-94,-850,-545,15"
_NO_SERVICE = Air(("+CPSI: NO SERVICE,Online",), "99,99")

AIRS = {
    Access.NONE: _NO_SERVICE,
    Access.SEARCHING: _NO_SERVICE,
    Access.LTE: Air((_LTE, "+CPSI: NOT IN EN-DC CONNECTED MODE"), "20,99"),
    Access.NSA: Air((_LTE, "+CPSI: NR5G_NSA,644,NR5G_BAND78,627264,-960,-120,95"), "20,99", 13),
    Access.SA: Air(("+CPSI: NR5G_SA,Online,242-12,0x765D,4955280,0,NR5G_BAND78,640704,-770,-110,290",), "99,99", 11),
}

# <stat> of a domain: 0 none, 1 home, 2 searching, 3 denied. LTE and NSA are registered in CEREG, SA in C5GREG.
_REGISTERED = {"CEREG": (Access.LTE, Access.NSA), "CGREG": (), "C5GREG": (Access.SA,), "CREG": (Access.LTE, Access.NSA)}


class SimulatedNetwork:
    """Coverage, and registration of the modem.

    offered    best access of the coverage; NONE: no coverage.
    denies     True: the network refuses the subscription.
    attached   True: packets are allowed.
    changed    called at each change of the registration.
    """

    def __init__(self, loop: Loop, changed: Callable[[], None]) -> None:
        self.offered = Access.NSA
        self.camped = Access.NONE
        self.denies = False
        self.attached = False
        self.is_context_up = False
        self._loop = loop
        self._changed = changed
        self._timer: Timer | None = None

    def search(self) -> None:
        """Start a new search for cells."""
        self.leave(Access.SEARCHING)
        self._after(SEARCH_S)

    def leave(self, camped: Access = Access.NONE) -> None:
        """Give up the registration, and end a running search. camped: the new state, NONE or SEARCHING."""
        self.attached = self.is_context_up = False
        if self._timer is not None:
            self._timer.cancel()
        self._camp(camped)

    def offer(self, access: Access) -> None:
        """Change the coverage, such as in a tunnel or in a town with 5G."""
        self.offered = access
        if self.camped > access:
            self.search()
        elif self.camped is not Access.NONE:
            self._after(STEP_S)

    def status(self, domain: str) -> int:
        """Return <stat> of a domain."""
        if self.camped in _REGISTERED[domain]:
            return 1
        if self.denies and self.camped is Access.SEARCHING:
            return 3
        return 2 if self.camped is Access.SEARCHING else 0

    @property
    def is_registered(self) -> bool:
        return self.camped >= Access.LTE

    def _after(self, delay: float) -> None:
        if self._timer is not None:
            self._timer.cancel()
        self._timer = self._loop.after(delay, self._advance)

    def _advance(self) -> None:
        if self.denies or self.offered < Access.LTE or self.camped >= self.offered:
            return
        self.attached = True  # LTE and 5G attach when they register
        self._camp(Access(self.camped + 1))
        if self.camped < self.offered:
            self._after(STEP_S)

    def _camp(self, access: Access) -> None:
        if access is not self.camped:
            self.camped = access
            self._changed()
