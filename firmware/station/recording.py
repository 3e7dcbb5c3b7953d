"""Recorder of the station: starts and supervises the recorder process.

The process receives frame reports as a subscriber of the report port and writes them to disk. A slow, full or missing
disk delays only that process. See firmware/recorder.
"""

import json
import logging
import os
from collections.abc import Callable, Sequence
from pathlib import Path

from board.runtime.errors import RequestError
from board.runtime.loop import Loop
from board.runtime.worker import Worker
from firmware.config.tables import EndpointOptions, RecorderOptions
from firmware.endpoint.control.question import Question
from firmware.station.storage import FOLDER

WORKER = "recorder"
# Seconds without a report after which the process is restarted. It reports once a second, but a disk may block it for
# long. Messages then wait in its sockets; when these are full, messages are counted as missed.
SILENCE_S = 60.0
ANY = {"0.0.0.0": "127.0.0.1", "*": "127.0.0.1", "::": "::1"}
LONGEST = 200  # largest number of characters of a trigger's reason that are kept

log = logging.getLogger("captain.recorder")


class Recorder:
    """Supervisor of the recorder process: starts it, and restarts it after a failure.

    private  second ZeroMQ address of the report port, only for the recorder; empty: its TCP port.
    command  command line of the process; empty: this program.
    state    returns the station's folder for persistent files, on which a relative `folder` is based.
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
        self._state: object = None  # last state that the process reported; a restarted process continues from it
        self._why = "not started"
        self._worker = Worker(loop, WORKER, self._message, self._changed, command=command, silence_s=SILENCE_S)

    def start(self) -> None:
        self._worker.start()

    def stop(self) -> None:
        """Ask the process to write its buffers and end; do not wait for its end."""
        self._worker.stop()

    def finish(self) -> None:
        """Stop the process at the end of the program."""
        self._worker.finish()

    def trigger(self, question: Question) -> dict[str, object]:
        """Answer {"do": "record", "text": REASON}: keep the recent recording.

        Raises RequestError if the text is missing, or if the recorder does not run.
        """
        text = question.get("text")
        if not isinstance(text, str) or not text.strip():
            raise RequestError("text: missing reason", 'give a reason: captain record --trigger "near miss"')
        if not self._worker.send(json.dumps({"trigger": text[:LONGEST]}).encode()):
            raise RequestError(f"the recorder does not run: {self._why}")
        return {"folder": self._asked["folder"]}

    def status(self) -> dict[str, object]:
        """Return the recorder's part of the status.

        is_running  true while the process runs.
        why         state of the process, in words.
        restarts    number of restarts of the process.
        """
        return {"is_running": self._worker.is_up, "why": self._why, "restarts": self._worker.restarts, **self._told}

    def _changed(self, is_up: bool, why: str) -> None:
        self._why = why
        log.log(logging.INFO if is_up else logging.WARNING, "%s", why)
        if is_up:
            self._worker.send(json.dumps({**self._asked, "state": self._state}).encode())

    def _message(self, message: bytes) -> None:
        self._told = json.loads(message)
        self._state = self._told.pop("state") or self._state
