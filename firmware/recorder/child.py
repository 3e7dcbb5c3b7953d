"""The recorder as a process of the station: told what to do by its first message, and what to keep by others."""

import json
import math
import os
import socket
import time
from contextlib import suppress
from pathlib import Path

from board.errors import StationError
from firmware.recorder.hearing import Hearing, say
from firmware.recorder.recovery import restore, state_of
from firmware.recorder.ring import Limits
from firmware.recorder.sinks import Keeper
from firmware.user import client

NICE = 10  # routing goes first
TELL_S = 1.0
MOST = 65536
DRAIN_S = 0.2


def serve(channel: socket.socket) -> None:
    """Until the station says stop."""
    os.nice(NICE)
    asked = json.loads(channel.recv(MOST) or b"{}")
    if not asked:
        return
    folder = Path(asked["folder"])
    with suppress(OSError):
        folder.mkdir(exist_ok=True)
    limits = Limits(asked["size"], asked["age_s"], asked["before_s"], asked["after_s"], asked["is_memory_fine"])
    keeper = Keeper(folder, limits, frozenset(asked["keep_on"]))
    if asked["state"]:
        restore(keeper.ring, asked["state"])
    place = client.Address(asked["host"], report=asked["report"])
    with client.session() as context:
        try:
            hearing = Hearing(context, place, private=asked["private"])
            hearing.on_status, hearing.on_time = keeper.know, keeper.time
            ear = Ear(channel, keeper, hearing)
            keeper.ring.on_file = ear.tell
            for told in hearing.frames(ear.goes_on):
                keeper.add(told)
        except StationError as error:
            say(f"recorder: {error.message}")
        finally:
            keeper.close()


class Ear:
    """The station's end: what it asks, and what it is told once a second."""

    def __init__(self, channel: socket.socket, keeper: Keeper, hearing: Hearing) -> None:
        self._channel = channel
        self._keeper = keeper
        self._hearing = hearing
        self._told_at = 0.0
        self._ends = math.inf

    def goes_on(self) -> bool:
        """Do what is asked; False when that is to stop."""
        while True:
            try:
                message = self._channel.recv(MOST, socket.MSG_DONTWAIT)
            except BlockingIOError:
                break
            if not message:
                return self._drains()
            self._keeper.trigger(json.loads(message)["trigger"])
        if self._hearing.is_known:
            self._keeper.idle()
        now = time.monotonic()
        if now >= self._told_at + TELL_S:
            self._told_at = now
            self.tell()
        return True

    def tell(self) -> None:
        """Status, and what the next process needs should this one be killed."""
        ring = self._keeper.ring
        state = state_of(ring)
        self._channel.send(json.dumps({**ring.status(), "state": state and state._asdict()}).encode())

    def _drains(self) -> bool:
        """The station ends: what it told last is on its way for a moment."""
        self._ends = min(self._ends, time.monotonic() + DRAIN_S)
        return time.monotonic() < self._ends
