"""A handler of the V2Xcast library and its thread: made, used and released there, and made again when it fails.

Handler is the vendor's word: what eu_caster_create() gives for one direction of a caster, TX or RX.
"""

import queue
import time
from abc import ABC, abstractmethod
from contextlib import AbstractContextManager
from threading import Event, Thread
from typing import ClassVar

from drivers.v2xcast_library import Buffers, CallError, Kind, Library
from drivers.v2xcast_outbox import Outbox
from drivers.v2xcast_watch import Watch
from drivers.wire import v2xcast as wire

# How long making a handler may take before the library counts as hung; nothing public says how long it does. It
# talks IP to the module, which may be restarting: that takes 30 s.
CREATE_S = 60.0

RX_TIMEOUT_MS = 250  # how long a receiving call blocks: the process has to leave within half a second

FIRST_DELAY_S = 0.5  # between a handler that could not be made and the next try, doubled each time
LONGEST_DELAY_S = 5.0
LIMIT_DELAY_S = 30.0  # the module is full: somebody else must give a place back first
STEADY_S = 5.0  # a handler that worked for so long is made again at once when it fails


class Module:
    """What the handlers of a process have in common: the module as the library shows it.

    call_s  seconds after which a call counts as hung.
    epoch   counts how often the module was lost: a handler of an earlier epoch has to be made again.
    """

    def __init__(self, library: Library, ip: str, call_s: float, outbox: Outbox, watch: Watch) -> None:
        self.library = library
        self.ip = ip
        self.call_s = call_s
        self.outbox = outbox
        self.watch = watch
        self.stopping = Event()
        self.epoch = 0
        self._transmitters: list[Transmitter] = []

    def add(self, transmitter: "Transmitter") -> None:
        self._transmitters.append(transmitter)

    def lost(self, epoch: int) -> None:
        """A handler that was made in an epoch says that the module is gone: then it is for the others as well."""
        if epoch == self.epoch:
            self.epoch += 1
            self.wake()

    def wake(self) -> None:
        """Have those look who wait for requests."""
        for transmitter in self._transmitters:
            transmitter.requests.put(None)

    def stop(self) -> None:
        self.stopping.set()
        self.wake()


class Handler(ABC):
    """One handler and the thread that uses it.

    place      of its caster in the settings.
    caster_id  on the module.
    why_not    it works; empty when it does.
    """

    mode: ClassVar[int]
    word: ClassVar[str]

    def __init__(self, module: Module, place: int, caster_id: int) -> None:
        self.module = module
        self.place = place
        self.why_not: str | None = None
        self._caster_id = caster_id
        self._name = f"caster {caster_id} {self.word}"
        self._epoch: int | None = None  # in which it was made last
        self._since = 0.0  # when that was
        self._failures = 0
        self.thread = Thread(target=self._run, name=self._name, daemon=True)

    @abstractmethod
    def work(self, handler: int) -> None:
        """Use it until is_over(), and say works() as soon as it does. Raises CallError."""

    @abstractmethod
    def rest(self, delay_s: float) -> None:
        """Let so much time go by, or less where it is over."""

    def is_over(self) -> bool:
        return self.module.stopping.is_set() or self._epoch != self.module.epoch

    def works(self) -> None:
        self._tell("")

    def call(self, what: str) -> AbstractContextManager[None]:
        """Around a call of the library: it is watched."""
        return self.module.watch.call(f"{what} of {self._name}", self.module.call_s)

    def _run(self) -> None:
        while not self.module.stopping.is_set():
            try:
                handler = self._create()
            except CallError as error:
                self._not_created(error)
            else:
                self._use(handler)

    def _create(self) -> int:
        module = self.module
        epoch = module.epoch
        with module.watch.call(f"eu_caster_create of {self._name}", CREATE_S):
            handler = module.library.create(module.ip, self._caster_id, self.mode)
        self._epoch = epoch
        self._since = time.monotonic()
        return handler

    def _use(self, handler: int) -> None:
        failure = None
        try:
            self.work(handler)
        except CallError as error:
            self._note(error)
            failure = error
        self._release(handler)
        if time.monotonic() - self._since >= STEADY_S:
            self._failures = 0
        elif failure is not None:
            self._tell(failure.message)
            self.rest(self._delay())

    def _release(self, handler: int) -> None:
        try:
            with self.call("eu_caster_release"):
                self.module.library.release(handler)
        except CallError as error:
            self._note(error)

    def _not_created(self, error: CallError) -> None:
        if error.kind is Kind.ABSENT and self._epoch is not None:
            self.module.lost(self._epoch)
        self._tell(error.message)
        self.rest(LIMIT_DELAY_S if error.kind is Kind.LIMIT else self._delay())

    def _delay(self) -> float:
        delay = min(LONGEST_DELAY_S, FIRST_DELAY_S * 2.0 ** min(self._failures, 8))
        self._failures += 1
        return delay

    def _note(self, error: CallError) -> None:
        self.module.outbox.say(wire.note(f"{self._name}: {error.message}"))

    def _tell(self, why_not: str) -> None:
        if why_not != self.why_not:
            self.why_not = why_not
            self.module.outbox.say(wire.state(self.place, self.mode, why_not))


class Receiver(Handler):
    """Receives for one caster."""

    mode = wire.RX
    word = "rx"

    def work(self, handler: int) -> None:
        library, outbox, place = self.module.library, self.module.outbox, self.place
        buffers = Buffers()
        timeout_ms = 0  # the first call shows whether it works
        while not self.is_over():
            with self.call("eu_caster_rx_timeout"):
                got = library.receive(handler, buffers, timeout_ms)
            if got is not None:
                outbox.put(place, got.pdu, wire.received(place, time.time_ns(), *got))
            if not timeout_ms:
                self.works()
                timeout_ms = RX_TIMEOUT_MS

    def rest(self, delay_s: float) -> None:
        self.module.stopping.wait(delay_s)


class Transmitter(Handler):
    """Sends for one caster.

    requests  what to send; None where something else has changed. The station sends few ahead, so it is bounded.
    """

    mode = wire.TX
    word = "tx"

    def __init__(self, module: Module, place: int, caster_id: int) -> None:
        super().__init__(module, place, caster_id)
        self.requests: queue.SimpleQueue[wire.ToSend | None] = queue.SimpleQueue()
        module.add(self)

    def work(self, handler: int) -> None:
        self.works()
        while not self.is_over():
            request = self.requests.get()
            if request is not None:
                self._transmit(handler, request)

    def rest(self, delay_s: float) -> None:
        """Requests that come meanwhile are refused: their users hear of it at once."""
        end = time.monotonic() + delay_s
        while not self.module.stopping.is_set():
            try:
                request = self.requests.get(timeout=max(0.0, end - time.monotonic()))
            except queue.Empty:
                return
            if request is not None:
                self.module.outbox.say(wire.sent(request.number, self.why_not or "it does not work"))

    def _transmit(self, handler: int, request: wire.ToSend) -> None:
        outbox = self.module.outbox
        try:
            with self.call("eu_caster_tx"):
                self.module.library.transmit(handler, request.tx_info, request.pdu)
        except CallError as error:
            outbox.say(wire.sent(request.number, error.message))
            if error.kind is not Kind.LENGTH:
                raise
        else:
            outbox.say(wire.sent(request.number))
