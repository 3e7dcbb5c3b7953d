"""The station's recorder: a process of its own, which listens as any user does and writes what it hears to a card.

A card that is slow, full or gone holds up that process alone. See firmware/recorder.
"""

import json
import logging
import os
from collections.abc import Callable, Sequence
from pathlib import Path

from board.errors import RequestError
from board.loop import Loop
from board.worker import Worker
from firmware.question import Question
from firmware.storage import FOLDER
from firmware.tables import EndpointOptions, RecorderOptions

WORKER = "recorder"
# It says something once a second. A card may hold it for long: what comes meanwhile waits in its sockets, and is
# counted where they are full.
SILENCE_S = 60.0
ANY = {"0.0.0.0": "127.0.0.1", "*": "127.0.0.1", "::": "::1"}
LONGEST = 200  # characters of a reason

log = logging.getLogger("captain.recorder")


class Recorder:
    """Starts it, and starts it again when it fails.

    private  ZeroMQ address of the report port that no peer of the endpoint shares.
    command  that leads to the process; empty for this program.
    """

    def __init__(
        self,
        loop: Loop,
        options: RecorderOptions,
        endpoint: EndpointOptions,
        private: str = "",
        command: Sequence[str] = (),
        state: Callable[[], str] = lambda: os.environ.get(FOLDER, "").partition(":")[0],
    ) -> None:
        self._options = options
        self._asked = {
            "host": ANY.get(endpoint.address, endpoint.address),
            "report": endpoint.report,
            "private": private,
            "folder": str(Path(state()) / options.folder),
            "size": options.size_mb << 20,
            "age_s": options.age_s,
            "keep_on": options.keep_on,
            "before_s": options.before_s,
            "after_s": options.after_s,
            "is_memory_fine": options.in_memory,
        }
        self._told: dict[str, object] = {}
        self._state: object = None  # what a process hands to the next one, should it be killed
        self._why = "not started"
        self._worker = Worker(loop, WORKER, self._message, self._changed, command=command, silence_s=SILENCE_S)

    def start(self) -> None:
        self._worker.start()

    def stop(self) -> None:
        """Let it write what it has; returns at once."""
        self._worker.stop()

    def finish(self) -> None:
        """As stop(), for the end of the program."""
        self._worker.finish()

    def trigger(self, question: Question) -> dict[str, object]:
        """Keep what was, for the reason in "text". Raises RequestError."""
        text = question.get("text")
        if not isinstance(text, str) or not text.strip():
            raise RequestError("text: a reason is missing", 'say why: captain record --trigger "near miss"')
        if not self._worker.send(json.dumps({"trigger": text[:LONGEST]}).encode()):
            raise RequestError(f"the recorder does not run: {self._why}")
        return {"folder": self._asked["folder"]}

    def status(self) -> dict[str, object]:
        return {"is_running": self._worker.is_up, "why": self._why, "restarts": self._worker.restarts, **self._told}

    def _changed(self, is_up: bool, why: str) -> None:
        self._why = why
        log.log(logging.INFO if is_up else logging.WARNING, "%s", why)
        if is_up:
            self._worker.send(json.dumps({**self._asked, "state": self._state}).encode())

    def _message(self, message: bytes) -> None:
        self._told = json.loads(message)
        self._state = self._told.pop("state") or self._state
