"""Mobile network and TCP in virtual time: in order, with retries.

It keeps what a real kernel does to a message. Octets of a connection wait in its sender and arrive late, all of them,
when the network is back. A connection from an address that is gone never speaks again, without notice. A sender
learns of neither before a limit of its own has passed.
"""

from collections import deque
from collections.abc import Callable

from board.runtime.loop import Loop, Timer
from drivers.mqtt.client.connector import UNSENT
from tests.proof.outage.pattern import NEW_ADDRESS, Kind, Trouble

Call = Callable[[], None]

DELAY_S = 0.03  # one way, LTE on a good day
SLOW_DELAY_S = 0.25
FIRST_RTO_S = 0.25  # of a retransmission, doubled with each; 0.2 s is Linux' least
LONGEST_RTO_S = 120.0  # TCP_RTO_MAX
HEADER = 60  # octets of IP, TCP and its options

# Octets that a sender's kernel has, sent and not acknowledged. Of Linux with the options of a connection to a broker a
# poll says "writable" for 12 to 14 messages of 150 octets, and for 3 of 1500, while nothing passes.
BUFFER = 3000
WRITABLE = BUFFER + UNSENT // 2  # poll() asks for twice as much room as send() does (tcp_stream_memory_free)

FLIGHT_S = 0.5  # of a slow network: what it is given at once


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
    """One direction. A process gives octets to its kernel as far as that takes them, and keeps the rest.

    What the kernel has travels together, the next when that has arrived: a window of one flight. A slow network has
    flights of FLIGHT_S.

    on_room  called when the kernel can take more, after it could not.
    """

    def __init__(self, line: Line, stall_s: float) -> None:
        self.on_room: Call = lambda: None
        self._line = line
        self._network = line.network
        self._loop = line.network.loop
        self._stall_s = stall_s
        self._outside: deque[tuple[int, Call, Call]] = deque()  # in the process, out of its reach
        self._kernel: deque[tuple[int, Call]] = deque()
        self._octets = 0  # of the kernel
        self._flight = 0  # how many of the first are under way
        self._rto_s = FIRST_RTO_S
        self._first_lost: float | None = None
        self._timer: Timer | None = None

    def send(self, octets: int, arrive: Call, taken: Call = lambda: None) -> None:
        """taken is called when the kernel has it: at once, or when there is room, and in its turn."""
        self._outside.append((octets, arrive, taken))
        self._take()
        if self._timer is None:
            self._fly()

    @property
    def is_writable(self) -> bool:
        """What poll() says, and nothing waits in the process."""
        return not self._outside and self._octets < WRITABLE

    def clear(self) -> None:
        self._outside.clear()
        self._kernel.clear()
        if self._timer is not None:
            self._timer.cancel()

    def _take(self) -> None:
        while self._outside and self._octets < BUFFER + UNSENT:
            octets, arrive, taken = self._outside.popleft()
            self._octets += octets
            self._kernel.append((octets, arrive))
            taken()

    def _fly(self, follows: bool = False) -> None:
        """follows: another flight is just in front of it, so that only its own octets take time."""
        network = self._network
        took_s, self._flight = network.delay_s, len(self._kernel)
        if network.rate:
            self._flight, took_s = 0, 0.0
            for octets, _ in self._kernel:
                took_s += (octets + HEADER) / network.rate
                self._flight += 1
                if took_s >= FLIGHT_S:
                    break
            took_s += 0.0 if follows else network.delay_s
        self._timer = self._loop.after(took_s, self._land if self._line.passes else self._lose)

    def _land(self) -> None:
        if not self._line.passes:
            self._lose()
            return
        self._rto_s, self._first_lost = FIRST_RTO_S, None
        was_full = not self.is_writable
        for _ in range(self._flight):
            octets, arrive = self._kernel.popleft()
            self._octets -= octets
            arrive()
            if not self._line.is_alive:
                return
        self._take()
        self._timer = None
        if self._kernel:
            self._fly(follows=True)  # before anybody hears of the room: what comes then would be a flight by itself
        if was_full and self.is_writable:
            self.on_room()

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
