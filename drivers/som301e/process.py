"""The radio's process: runs the vendor's library, with one thread for each handler.

The library requires a thread for each handler. The driver starts this process as a worker (module.py). The process
reads settings, then requests. It sends received messages and the states of its handlers. These messages are defined in
wire/v2xcast.py. The process ends when the station closes its socket.
"""

import json
import os
import socket
import threading
import time
import traceback
from threading import Thread
from typing import Any, NamedTuple

from board.runtime.errors import InterfaceError
from board.runtime.worker import messages
from drivers.som301e.handler import CREATE_S, CasterReceiver, Handler, Module, Transmitter
from drivers.som301e.library import CallError, Library
from drivers.som301e.outbox import Outbox
from drivers.som301e.watchdog import CHECK_S, Watch
from drivers.wire import v2xcast as wire

# Time limit for a call that receives (normally 0.25 s), sends or releases; after it the library counts as hung.
CALL_S = 5.0

# Time for all threads to give the module's handlers back to its library. Soon after, the station kills the process.
LEAVE_S = 0.4

# Small, because a DENM cannot overtake messages that are already in the socket. The kernel doubles this size and counts
# about 800 octets for a CAM.
SEND_BUFFER = 8192


class Caster(NamedTuple):
    """A service of the module, and the directions for which it gets a handler."""

    caster_id: int
    receives: bool
    transmits: bool


class Settings(NamedTuple):
    """Settings in the station's first message, as a JSON object.

    library  path of the vendor's library.
    ip       IPv4 address of the module.
    casters  services of the module that are used.
    urgent   messageIDs of urgent PDUs.
    call_s   seconds after which a library call counts as hung; shorter in tests.
    check_s  interval in seconds in which the watchdog looks; shorter in tests.
    """

    library: str
    ip: str
    casters: tuple[Caster, ...]
    urgent: frozenset[int]
    call_s: float = CALL_S
    check_s: float = CHECK_S

    @classmethod
    def read(cls, octets: bytes) -> "Settings":
        fields: dict[str, Any] = json.loads(octets)
        casters = tuple(Caster(*caster) for caster in fields.pop("casters"))
        return cls(casters=casters, urgent=frozenset(fields.pop("urgent")), **fields)


def serve(channel: socket.socket) -> None:
    """Run the radio until the station closes its end of the channel, a socket."""
    incoming = messages(channel)
    first = next(incoming, None)
    if first is None:
        return
    _silence()
    threading.excepthook = _bug
    channel.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
    radio = Radio(Settings.read(first))
    Thread(target=_write, args=(channel, radio.outbox), daemon=True).start()
    try:
        radio.start()
        for message in incoming:
            radio.take(message)
    finally:
        radio.stop()


class Radio:
    """The library and its handlers.

    outbox  messages to the station.
    """

    def __init__(self, settings: Settings) -> None:
        self.outbox = Outbox(len(settings.casters), settings.urgent)
        self._settings = settings
        self._watch = Watch(self._overdue, self.outbox.beat, settings.check_s)
        self._module: Module | None = None
        self._handlers: list[Handler] = []
        self._transmitters: dict[int, Transmitter] = {}

    def start(self) -> None:
        """Load the library and start a thread for each handler. If the library fails, report a fault instead."""
        settings = self._settings
        Thread(target=self._watch.run, daemon=True).start()
        try:
            library = Library(settings.library)
            with self._watch.call("eu_caster_init", CREATE_S):
                library.init()
        except InterfaceError as error:
            is_library = not isinstance(error, CallError)
            self.outbox.say(wire.fault(is_library, error.message, error.hint))
            return
        self._module = module = Module(library, settings.ip, settings.call_s, self.outbox, self._watch)
        for index, caster in enumerate(settings.casters):
            if caster.transmits:
                self._transmitters[index] = Transmitter(module, index, caster.caster_id)
            if caster.receives:
                self._handlers.append(CasterReceiver(module, index, caster.caster_id))
        self._handlers += self._transmitters.values()
        for handler in self._handlers:
            handler.thread.start()

    def take(self, message: bytes) -> None:
        """Handle a message of the station: a request, or a question for the drop count."""
        if message[0] == wire.COUNT:
            dropped = self.outbox.take_dropped()
            if dropped:
                self.outbox.say(wire.counted(dropped))
            return
        request = wire.to_send(message)
        transmitter = self._transmitters.get(request.caster)
        if transmitter is None:
            self.outbox.say(wire.sent(request.number, "the library was not loaded"))
        else:
            transmitter.requests.put(request)

    def stop(self) -> None:
        """Let every thread release its handler, at most for LEAVE_S; a thread that hangs is left behind."""
        self._watch.stop()
        module = self._module
        if module is not None:
            module.stop()
            end = time.monotonic() + LEAVE_S
            for handler in self._handlers:
                handler.thread.join(max(0.0, end - time.monotonic()))
            if not any(handler.thread.is_alive() for handler in self._handlers):
                module.library.deinit()
        self.outbox.close()

    def _overdue(self, what: str) -> None:
        self.outbox.say(wire.fault(False, what, "the process that runs the library is started again"))


def _write(channel: socket.socket, outbox: Outbox) -> None:
    while (message := outbox.take()) is not None:
        try:
            channel.send(message)
        except (BrokenPipeError, ConnectionResetError):
            return  # the station has closed its end; the main thread notices it too, and ends the process


def _silence() -> None:
    """Redirect stdout to /dev/null, because the library may print any text, which would fill the journal.

    Own errors go to stderr, which stays.
    """
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.close(nowhere)


def _bug(unexpected: threading.ExceptHookArgs) -> None:
    """End the process after an unexpected exception in a thread, as one in the main thread would."""
    traceback.print_exception(unexpected.exc_type, unexpected.exc_value, unexpected.exc_traceback)
    os._exit(1)
