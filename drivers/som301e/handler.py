"""Handler of the V2Xcast library, with its thread, which creates, uses, releases and re-creates it.

Handler is the vendor's word: eu_caster_create() returns one for one direction of a caster, TX or RX.
"""

import queue
import time
from abc import ABC, abstractmethod
from contextlib import AbstractContextManager
from threading import Event, Thread
from typing import ClassVar

from drivers.som301e.library import Buffers, CallError, CasterKind, Library
from drivers.som301e.outbox import Outbox
from drivers.som301e.watchdog import Watch
from drivers.wire import v2xcast as wire

# Time limit for the creation of a handler; after it the library counts as hung. Public documents do not say how long it
# takes. The library uses IP to the module, which may be restarting: that takes 30 s.
CREATE_S = 60.0

RX_TIMEOUT_MS = 250  # blocking time of a receive call: the process must be able to end within half a second

FIRST_DELAY_S = 0.5  # delay after the first failed creation of a handler; it is doubled after each further failure
LONGEST_DELAY_S = 5.0
LIMIT_DELAY_S = 30.0  # delay when the module has no free handler: another program must release one first
STEADY_S = 5.0  # a handler that worked for at least this time is re-created without delay when it fails


class Module:
    """State that all handlers of a process share: library, module address, outbox and watchdog.

    ip      IPv4 address of the module.
    call_s  seconds after which a library call counts as hung.
    epoch   number of times that the module was lost. Handlers created in an earlier epoch must be created again.
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
        """Start a new epoch, because a handler has found that the module is gone; all handlers are then re-created.

        epoch  epoch in which that handler was created; ignored unless it is the current one.
        """
        if epoch == self.epoch:
            self.epoch += 1
            self.wake()

    def wake(self) -> None:
        """Wake the transmitters that wait for requests, so that they check for an end or a new epoch."""
        for transmitter in self._transmitters:
            transmitter.requests.put(None)

    def stop(self) -> None:
        self.stopping.set()
        self.wake()


class Handler(ABC):
    """One handler and the thread that uses it.

    index      index of its caster in the settings.
    caster_id  identifier of the caster on the module.
    why_not    reason why the handler does not work; empty if it works, None before the first result.
    """

    mode: ClassVar[int]
    word: ClassVar[str]

    def __init__(self, module: Module, index: int, caster_id: int) -> None:
        self.module = module
        self.index = index
        self.why_not: str | None = None
        self._caster_id = caster_id
        self._name = f"caster {caster_id} {self.word}"
        self._epoch: int | None = None  # epoch of the last creation
        self._since = 0.0  # time of the last creation, by the monotonic clock
        self._failures = 0
        self.thread = Thread(target=self._run, name=self._name, daemon=True)

    @abstractmethod
    def work(self, handler: int) -> None:
        """Use the handler until is_over(); call works() as soon as it works. Raises CallError if a call fails."""

    @abstractmethod
    def rest(self, delay_s: float) -> None:
        """Wait for a time in seconds, less if the process ends."""

    def is_over(self) -> bool:
        return self.module.stopping.is_set() or self._epoch != self.module.epoch

    def works(self) -> None:
        self._tell("")

    def call(self, what: str) -> AbstractContextManager[None]:
        """Return the context of a library call: within it the watchdog limits the call's time."""
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
        if error.kind is CasterKind.ABSENT and self._epoch is not None:
            self.module.lost(self._epoch)
        self._tell(error.message)
        self.rest(LIMIT_DELAY_S if error.kind is CasterKind.LIMIT else self._delay())

    def _delay(self) -> float:
        delay = min(LONGEST_DELAY_S, FIRST_DELAY_S * 2.0 ** min(self._failures, 8))
        self._failures += 1
        return delay

    def _note(self, error: CallError) -> None:
        self.module.outbox.say(wire.note(f"{self._name}: {error.message}"))

    def _tell(self, why_not: str) -> None:
        if why_not != self.why_not:
            self.why_not = why_not
            self.module.outbox.say(wire.state(self.index, self.mode, why_not))


class CasterReceiver(Handler):
    """Handler that receives the messages of one caster."""

    mode = wire.RX
    word = "rx"

    def work(self, handler: int) -> None:
        library, outbox, index = self.module.library, self.module.outbox, self.index
        buffers = Buffers()
        timeout_ms = 0  # the first call returns at once and so shows whether the handler works
        while not self.is_over():
            with self.call("eu_caster_rx_timeout"):
                got = library.receive(handler, buffers, timeout_ms)
            if got is not None:
                outbox.put(index, got.pdu, wire.received(index, time.time_ns(), *got))
            if not timeout_ms:
                self.works()
                timeout_ms = RX_TIMEOUT_MS

    def rest(self, delay_s: float) -> None:
        self.module.stopping.wait(delay_s)


class Transmitter(Handler):
    """Handler that sends the messages of one caster.

    requests  queue of requests; None only wakes the thread. The queue is bounded because the station has at most
              module.WINDOW unconfirmed requests.
    """

    mode = wire.TX
    word = "tx"

    def __init__(self, module: Module, index: int, caster_id: int) -> None:
        super().__init__(module, index, caster_id)
        self.requests: queue.SimpleQueue[wire.ToSend | None] = queue.SimpleQueue()
        module.add(self)

    def work(self, handler: int) -> None:
        self.works()
        while not self.is_over():
            request = self.requests.get()
            if request is not None:
                self._transmit(handler, request)

    def rest(self, delay_s: float) -> None:
        """Wait for a time in seconds; refuse requests that arrive meanwhile, so their users get a confirm at once."""
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
            if error.kind is not CasterKind.LENGTH:
                raise
        else:
            outbox.say(wire.sent(request.number))
