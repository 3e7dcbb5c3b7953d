"""A mobile network in virtual time, and TCP over it: in order, again and again until it arrives or somebody gives up.

What a real kernel does is kept where it decides what becomes of a message: octets of a connection wait in its sender and
arrive late, all of them, when the network is back; a connection from an address that is gone never speaks again and says
nothing of that; a sender is told of neither before a limit of its own has passed.
"""

from collections import deque
from collections.abc import Callable

from board.loop import Loop, Timer
from drivers.mqtt_connector import UNSENT
from tests.outage.pattern import NEW_ADDRESS, Kind, Trouble

Call = Callable[[], None]

DELAY_S = 0.03  # one way, LTE on a good day
SLOW_DELAY_S = 0.25
FIRST_RTO_S = 0.25  # of a retransmission, doubled with each; 0.2 s is Linux' least
LONGEST_RTO_S = 120.0  # TCP_RTO_MAX
BUFFER = 3000  # octets that the network has, sent and not acknowledged
HEADER = 60  # octets of IP, TCP and its options


class Network:
    """Between a vehicle and a broker.

    is_open      whether anything passes.
    is_attached  whether the vehicle's device is up: else what is sent fails at once.
    address      of the vehicle, counted.
    """

    def __init__(self, loop: Loop) -> None:
        self.loop = loop
        self.is_open = True
        self.is_attached = True
        self.address = 0
        self.rate = 0.0  # octets per second; 0 is any
        self.delay_s = DELAY_S

    def begin(self, trouble: Trouble) -> None:
        if trouble.kind is Kind.SLOW:
            self.rate, self.delay_s = trouble.rate_bit_s / 8, SLOW_DELAY_S
            return
        self.is_open = False
        self.is_attached = trouble.kind is not Kind.LOSS

    def end(self, trouble: Trouble) -> None:
        self.is_open = self.is_attached = True
        self.rate, self.delay_s = 0.0, DELAY_S
        self.address += trouble.kind in NEW_ADDRESS


class Line:
    """A TCP connection: what is sent into it, from either end, arrives in order, or never.

    stall_s  the vehicle's kernel gives it up when what it has sent is not acknowledged for so long (TCP_USER_TIMEOUT,
             tcp(7)); 0: after a quarter of an hour or so, which nobody waits for here.
    on_end   called when it does.
    """

    def __init__(self, network: Network, stall_s: float, on_end: Callable[[str], None]) -> None:
        self.network = network
        self.address = network.address
        self.is_alive = True
        self.up = _Way(self, stall_s)
        self.down = _Way(self, 0.0)
        self._on_end = on_end

    @property
    def passes(self) -> bool:
        return self.network.is_open and self.address == self.network.address

    def close(self) -> None:
        """Nothing that waits in it arrives any more."""
        self.is_alive = False
        self.up.clear()
        self.down.clear()

    def stalled(self) -> None:
        self.close()
        self._on_end("does not answer any more")


class _Way:
    """One direction. All that waits travels together, the next when that has arrived: a window of one flight.

    on_room  called when the sender's kernel has taken all that was sent, after it had not.
    """

    def __init__(self, line: Line, stall_s: float) -> None:
        self.on_room: Call = lambda: None
        self._line = line
        self._network = line.network
        self._loop = line.network.loop
        self._stall_s = stall_s
        self._waiting: deque[tuple[int, Call]] = deque()
        self._unwritten: deque[tuple[int, Call]] = deque()
        self._octets = 0  # that wait
        self._flight = 0  # how many of the first are under way
        self._rto_s = FIRST_RTO_S
        self._first_lost: float | None = None
        self._timer: Timer | None = None

    def send(self, octets: int, arrive: Call, written: Call | None = None) -> None:
        """written is called once the kernel has taken it: at once, or when there is room. It is called in its turn."""
        self._waiting.append((octets, arrive))
        self._octets += octets
        if written is not None:
            self._unwritten.append((self._octets, written))
            self._loop.soon(self._write)
        if self._timer is None:
            self._fly()

    @property
    def has_room(self) -> bool:
        """Whether the sender's kernel has taken all that was sent."""
        return self._octets <= BUFFER + UNSENT

    def clear(self) -> None:
        self._waiting.clear()
        self._unwritten.clear()
        if self._timer is not None:
            self._timer.cancel()

    def _fly(self) -> None:
        self._flight = len(self._waiting)
        network = self._network
        took_s = network.delay_s
        if network.rate:
            took_s += sum(octets + HEADER for octets, _ in self._waiting) / network.rate
        self._timer = self._loop.after(took_s, self._land if self._line.passes else self._lose)

    def _land(self) -> None:
        if not self._line.passes:
            self._lose()
            return
        self._rto_s, self._first_lost = FIRST_RTO_S, None
        was_full = not self.has_room
        for _ in range(self._flight):
            octets, arrive = self._waiting.popleft()
            self._octets -= octets
            if self._unwritten:
                self._unwritten = deque((end - octets, written) for end, written in self._unwritten)
            arrive()
            if not self._line.is_alive:
                return
        self._write()
        self._timer = None
        if was_full and self.has_room:
            self.on_room()
        if self._waiting and self._timer is None:
            self._fly()

    def _write(self) -> None:
        while self._unwritten and self._unwritten[0][0] <= BUFFER + UNSENT:
            self._unwritten.popleft()[1]()

    def _lose(self) -> None:
        now = self._loop.clock()
        if self._first_lost is None:
            self._first_lost = now
        wait_s = self._rto_s
        self._rto_s = min(LONGEST_RTO_S, 2 * wait_s)
        if self._stall_s:
            # Linux shortens the last wait, so that it gives up in time.
            left_s = self._first_lost + self._stall_s - now
            if left_s <= 0:
                self._line.stalled()
                return
            wait_s = min(wait_s, left_s)
        self._timer = self._loop.after(wait_s, self._fly)
