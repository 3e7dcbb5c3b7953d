"""Account of every message: the station's reports beside the broker's deliveries."""

import math
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass, field

from drivers.reason import Reason

SENT = ""  # in place of a reason
UNTOLD = "untold"  # nothing was said of it
KEEP_S = 60.0  # after its deadline a message is closed: what arrives then is stale whatever it was

# Those that an outage explains. Any other is a fault of the station or of the broker.
EXPECTED = frozenset({Reason.EXPIRED, Reason.LINK_DOWN, Reason.QUEUE_FULL})
TOO_OLD = frozenset({Reason.EXPIRED, Reason.LINK_DOWN})

SAMPLES = 5  # of each kind of offence: the first ones say enough


@dataclass(slots=True)
class Message:
    """One request over one interface, while it is not closed.

    need_s  that the path has to work in its lifetime, so that it could have left.
    """

    number: int
    accepted: float
    deadline: float
    need_s: float
    said: str = UNTOLD
    said_at: float = 0.0
    arrived: int = 0
    left: int = 0  # the connection by which it left last


@dataclass
class Sums:
    """Of closed messages.

    outcomes  by what was said: SENT, a reason, UNTOLD.
    """

    requests: int = 0
    outcomes: Counter[str] = field(default_factory=Counter)
    arrived: int = 0
    repeats: int = 0
    arrived_late: int = 0  # after its deadline, in time when it left
    sent_in_vain: int = 0  # said to be sent, and has not arrived
    dropped_yet_arrived: int = 0  # it had left, and its acknowledgement never came
    latest_leaving_s: float = -math.inf  # between its deadline and when a socket has taken it
    longest_transit_s: float = 0.0  # between its deadline and its arrival
    latest_word_s: float = 0.0  # between its deadline and the word that it was dropped for its age


class Account:
    """Of one interface.

    transit_s   that the kernel may have a message which has left: it is stale when it arrives later than that after its
                deadline.
    word_s      within which after its deadline a message that did not leave is told to be dropped.
    was_usable  whether the path worked between two moments for so long in one piece: then nothing that needs no longer
                may be lost in that time.
    is_lossy    QoS 0: what is under way is lost with the connection, and nobody knows; but not while the path works.
    """

    def __init__(
        self,
        name: str,
        transit_s: float,
        word_s: float,
        was_usable: Callable[[float, float, float], bool],
        is_lossy: bool = False,
    ) -> None:
        self.name = name
        self.sums = Sums()
        self.offences: Counter[str] = Counter()
        self.samples: dict[str, list[str]] = {}
        self._transit_s = transit_s
        self._word_s = word_s
        self._was_usable = was_usable
        self.is_lossy = is_lossy
        self._open: dict[int, Message] = {}
        self._order: deque[Message] = deque()

    @property
    def length(self) -> int:
        """Messages that are not closed."""
        return len(self._open)

    def accepted(self, number: int) -> float:
        """When a request was made; one that is closed, long ago."""
        message = self._open.get(number)
        return -math.inf if message is None else message.accepted

    def request(self, number: int, accepted: float, deadline: float, need_s: float) -> None:
        self.sums.requests += 1
        message = self._open[number] = Message(number, accepted, deadline, need_s)
        self._order.append(message)

    def said(self, number: int, reason: Reason | None, now: float, is_full: bool = True) -> None:
        """What the station says of a request. is_full: whether its queue was, where that is known."""
        word = SENT if reason is None else reason.value
        message = self._open.get(number)
        if message is None or message.said != UNTOLD:
            self._offend("said twice, or of no request", f"{number}: {word or 'sent'}")
            return
        message.said, message.said_at = word, now
        if reason is None:
            if now > message.deadline + self._transit_s:
                self._offend("said to be sent after its lifetime", f"{number}: {now - message.deadline:.3f} s")
        elif reason not in EXPECTED:
            self._offend("dropped for a reason that no outage explains", f"{number}: {word}")
        elif reason in TOO_OLD:
            self._old(message, now)
        elif not is_full:
            self._offend("dropped by a queue with room", str(number))

    def left(self, number: int, connection: int, now: float) -> None:
        """A socket has taken it: that of so manyth connection. What has left cannot be taken back."""
        message = self._open.get(number)
        if message is None:
            self._offend("left long after its lifetime", str(number))
            return
        late_s = now - message.deadline
        self.sums.latest_leaving_s = max(self.sums.latest_leaving_s, late_s)
        if late_s > 0:
            self._offend("left after its lifetime", f"{number}: {late_s:.3f} s")
        if message.said != UNTOLD:
            self._offend("left after its outcome was told", f"{number}: {message.said or 'sent'}")
        if message.left == connection or (message.left and self.is_lossy):
            self._offend("left twice by one connection, or by QoS 0", str(number))
        message.left = connection

    def arrived(self, number: int, now: float) -> None:
        """It came out behind the broker."""
        message = self._open.get(number)
        if message is None:
            self._offend("stale, or of no request", str(number))
            return
        message.arrived += 1
        transit_s = now - message.deadline
        self.sums.arrived_late += transit_s > 0
        self.sums.longest_transit_s = max(self.sums.longest_transit_s, transit_s)
        if transit_s > self._transit_s:
            self._offend("stale", f"{number}: {transit_s:.1f} s after its lifetime")

    def close_old(self, now: float) -> None:
        """Close what nothing more will become of; called now and then, and with infinity at the end."""
        order = self._order
        while order and order[0].deadline + KEEP_S < now:
            self._close(order.popleft())

    def _close(self, message: Message) -> None:
        del self._open[message.number]
        sums = self.sums
        sums.outcomes[message.said] += 1
        sums.arrived += message.arrived > 0
        sums.repeats += max(0, message.arrived - 1)
        if message.said == UNTOLD:
            self._offend("nothing was said of it", str(message.number))
        elif message.said != SENT:
            sums.dropped_yet_arrived += message.arrived > 0
            if message.arrived and self.is_lossy:  # it is sent when the socket has it: nobody waits for more
                self._offend("said to be dropped, and arrived", str(message.number))
        elif not message.arrived:
            sums.sent_in_vain += 1
            at, need_s = message.said_at, message.need_s
            if not self.is_lossy or self._was_usable(at, at + need_s, need_s):
                self._offend("said to be sent, and did not arrive", str(message.number))

    def _old(self, message: Message, now: float) -> None:
        late_s = now - message.deadline
        self.sums.latest_word_s = max(self.sums.latest_word_s, late_s)
        if late_s < 0:
            self._offend("dropped for its age before its time", f"{message.number}: {-late_s:.3f} s")
        elif late_s > self._word_s:
            self._offend("dropped for its age and told late", f"{message.number}: {late_s:.3f} s")
        if self._was_usable(message.accepted, message.deadline, message.need_s):
            what = (
                "dropped although its acknowledgement could have come"
                if message.arrived
                else "lost although it could have left"
            )
            self._offend(what, f"{message.number}: accepted at {message.accepted:.1f}")

    def _offend(self, what: str, sample: str) -> None:
        self.offences[what] += 1
        samples = self.samples.setdefault(what, [])
        if len(samples) < SAMPLES:
            samples.append(sample)
