"""Recorder process of a station: configured by the first message, triggered by later ones."""

import json
import math
import os
import socket
import time
from contextlib import suppress
from pathlib import Path

from board.runtime.errors import StationError
from firmware.client import client
from firmware.recorder.hearing import Hearing, say
from firmware.recorder.recovery import restore, state_of
from firmware.recorder.ring import Limits
from firmware.recorder.sinks import Keeper

NICE = 10  # lets the station's routing run first
TELL_S = 1.0
MOST = 65536
DRAIN_S = 0.2


def serve(channel: socket.socket) -> None:
    """Record frames until the station closes the channel. The first message of the channel is the configuration."""
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
            hearing.sink = keeper
            ear = Ear(channel, keeper, hearing)
            keeper.ring.listener = ear
            for told in hearing.frames(ear.goes_on):
                keeper.add(told)
        except StationError as error:
            say(f"recorder: {error.message}")
        finally:
            keeper.close()


class Ear:
    """Channel to the station: receives triggers, sends the recorder's status once a second."""

    def __init__(self, channel: socket.socket, keeper: Keeper, hearing: Hearing) -> None:
        self._channel = channel
        self._keeper = keeper
        self._hearing = hearing
        self._told_at = 0.0
        self._ends = math.inf

    def goes_on(self) -> bool:
        """Process the station's triggers and send a due status; return False when recording shall end."""
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
            self.send_status()
        return True

    def file_closed(self) -> None:
        self.send_status()

    def send_status(self) -> None:
        """Send the status, with the counts from which the next process continues if this one is killed."""
        ring = self._keeper.ring
        state = state_of(ring)
        self._channel.send(json.dumps({**ring.status(), "state": state and state._asdict()}).encode())

    def _drains(self) -> bool:
        """Return whether to wait longer for the last frames: until DRAIN_S after the station has closed the channel."""
        self._ends = min(self._ends, time.monotonic() + DRAIN_S)
        return time.monotonic() < self._ends
