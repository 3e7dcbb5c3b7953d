"""The radio's process: the vendor's library, with one thread for each handler, as the library wants it.

Started by `som301e.py` as a worker. It reads settings, then requests, and tells what is received and how its
handlers are; wire/v2xcast.py has the messages. It ends when the station closes its socket.
"""

import json
import os
import socket
import threading
import time
import traceback
from threading import Thread
from typing import Any, NamedTuple

from board.errors import InterfaceError
from board.worker import messages
from drivers.v2xcast_handler import CREATE_S, Handler, Module, Receiver, Transmitter
from drivers.v2xcast_library import CallError, Library
from drivers.v2xcast_outbox import Outbox
from drivers.v2xcast_watch import CHECK_S, Watch
from drivers.wire import v2xcast as wire

# How long receiving (for a quarter of a second), sending or releasing may take before the library counts as hung.
CALL_S = 5.0

LEAVE_S = 0.4  # for all threads to release their handlers: a little later the station would kill the process

# Messages in the socket are those that no DENM overtakes. The kernel doubles it and counts some 800 octets for a CAM.
SEND_BUFFER = 8192


class Caster(NamedTuple):
    """A service of the module, and which handlers it gets."""

    caster_id: int
    receives: bool
    transmits: bool


class Settings(NamedTuple):
    """What the station says first, as a JSON object; urgent are messageIDs. Tests have shorter times."""

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
    """Run the radio until the station closes its end of the channel."""
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

    outbox  what the station will be told.
    """

    def __init__(self, settings: Settings) -> None:
        self.outbox = Outbox(len(settings.casters), settings.urgent)
        self._settings = settings
        self._watch = Watch(self._overdue, self.outbox.beat, settings.check_s)
        self._module: Module | None = None
        self._handlers: list[Handler] = []
        self._transmitters: dict[int, Transmitter] = {}

    def start(self) -> None:
        """Load the library and start a thread for each handler. A library that fails is told."""
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
        for place, caster in enumerate(settings.casters):
            if caster.transmits:
                self._transmitters[place] = Transmitter(module, place, caster.caster_id)
            if caster.receives:
                self._handlers.append(Receiver(module, place, caster.caster_id))
        self._handlers += self._transmitters.values()
        for handler in self._handlers:
            handler.thread.start()

    def take(self, message: bytes) -> None:
        """A message of the station."""
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
        """Have every thread release its handler; what does not return is left behind."""
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
            return  # the station has closed its end, and the main thread sees it as well


def _silence() -> None:
    """Take stdout from the library, which may print what it pleases into the journal. Errors of ours go to stderr."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.close(nowhere)


def _bug(unexpected: threading.ExceptHookArgs) -> None:
    """What a thread does not expect ends the process, as it would in the main thread."""
    traceback.print_exception(unexpected.exc_type, unexpected.exc_value, unexpected.exc_traceback)
    os._exit(1)
