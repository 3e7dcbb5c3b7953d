"""Reload: reads captain.toml again in a child process and replaces the policy."""

import json
import logging
from collections.abc import Callable, Sequence
from typing import Any

from board.runtime.child import Child, program
from board.runtime.errors import ConfigurationError, RequestError, StationError
from board.runtime.loop import Loop, Timer
from drivers.contract import Answer
from drivers.message import MessageType
from firmware.config.captain_toml import Config, ConfigSource
from firmware.routing.policy import Policy

WORKER = "reload"
# Time limit of the child process in seconds. It needs 2 s for a file of 10,000 rows, and may wait for the disk.
READ_S = 60.0
TOLD = 3  # number of row names that a log line contains at most
# First octet of a message from the child process: error, facts, part of a group of rows, last part of the group, end.
ERROR, FACTS, PART, ROWS, END = b"e", b"f", b"p", b"r", b"."

log = logging.getLogger("captain")


class Reload:
    """Reload of the policy: reads the configuration again, one reload at a time.

    source   files and overrides to read.
    running  configuration in force.
    make     returns a policy without rows.
    take     receives the new policy.
    names    returns the names of the rows in force.
    command  command line of the child process; empty: this program.

    Rows are added in parts, because 10,000 rows at once would block the loop for 0.3 s. A request during a reload
    causes another reload, because the file may have changed meanwhile.
    """

    def __init__(
        self,
        loop: Loop,
        source: ConfigSource,
        running: Config,
        make: Callable[[], Policy],
        take: Callable[[Policy], None],
        names: Callable[[], Sequence[str]],
        command: Sequence[str] = (),
    ) -> None:
        self._loop = loop
        self._source = source
        self._running = running
        self._written = running.written
        self._make = make
        self._take = take
        self._names = names
        self._command = command
        self._waiting: list[Answer] = []
        self._served: list[Answer] = []
        self._child: Child | None = None
        self._leaving: list[Child] = []
        self._deadline: Timer | None = None
        self._policy = make()
        self._parts = bytearray()
        self._facts: dict[str, Any] = {}

    def ask(self, answer: Answer) -> None:
        """Reload the policy. `answer` receives the number of `rows` when the new policy is in force, or the error."""
        self._waiting.append(answer)
        if self._child is None:
            self._begin()

    def add_kind(self, kind: MessageType) -> None:
        """Take a type that was added to the table of types, for a policy that is being made."""
        if self._child is not None:  # otherwise the router has this policy
            self._policy.add_kind(kind)

    def close(self) -> None:
        """End the child process; a second call has no effect."""
        child, self._child = self._child, None
        if self._deadline is not None:
            self._deadline.cancel()
        if child is not None:
            child.finish(0.0)
        for one in tuple(self._leaving):
            one.finish(0.0)

    # Called by the child process: board.runtime.child.Parent.

    def up(self, child: Child, pid: int) -> None:
        asked = {"source": self._source, "written": sorted(self._written)}
        if not child.send(json.dumps(asked).encode()):
            self._fail("the configuration cannot be read: its overrides are too long")

    def message(self, octets: bytes) -> None:
        kind, body = octets[:1], octets[1:]
        if kind in (PART, ROWS):
            self._parts += body
            if kind == ROWS:
                import pickle  # imported on demand, because few stations reload their policy

                self._policy.extend(pickle.loads(self._parts))
                self._parts.clear()
        elif kind == FACTS:
            self._facts = json.loads(body)
        elif kind == ERROR:
            self._end(ConfigurationError(*json.loads(body)))
        else:
            self._end(None)

    def writable(self) -> None: ...

    def ended(self, child: Child, why: str) -> None:
        if child is self._child:
            self._child = None
            self._fail(f"the configuration cannot be read: {why}")
        elif child in self._leaving:
            self._leaving.remove(child)

    def _begin(self) -> None:
        self._policy = self._make()
        self._parts.clear()
        self._served, self._waiting = self._waiting, []
        try:
            self._child = Child(self._loop, self, self._command or program(), WORKER)
        except OSError as error:
            self._fail(f"the configuration cannot be read: no process can be started: {error.strerror}")
            return
        late = f"the configuration cannot be read: it takes more than {READ_S:g} s"
        self._deadline = self._loop.after(READ_S, lambda: self._fail(late))

    def _fail(self, why: str) -> None:
        self._end(RequestError(why, "the policy in force stays; try again"))

    def _end(self, error: StationError | None) -> None:
        """Finish a reload: apply the policy unless there is an error, answer its requests, start the next reload."""
        child, self._child = self._child, None
        if child is not None:
            self._leaving.append(child)
            child.leave()
        if self._deadline is not None:
            self._deadline.cancel()
        if error is None:
            self._took()
        else:
            log.error("the policy stays as it was: %s", error)
        rows = len(self._policy.rows) - 1
        served, self._served = self._served, []
        for answer in served:
            answer({"rows": rows} if error is None else error)
        if self._waiting:
            self._begin()

    def _took(self) -> None:
        before, after = self._names(), [row.name for row in self._policy.rows]
        digests, self._written = self._facts["digests"], self._written.union(self._facts["written"])
        if changed := [name for name, digest in self._running.digests().items() if digests.get(name) != digest]:
            log.warning(
                "%s: changed but not applied: only [[policy]] is reloaded; restart captain to apply the rest",
                ", ".join(changed),
            )
        self._take(self._policy)
        log.info("policy reloaded: %s", difference(before[:-1], after[:-1]))


def difference(before: Sequence[str], after: Sequence[str]) -> str:
    """Return a text with the names of removed and added rows: at most TOLD of each, then the number of the others."""
    known, now = set(before), set(after)
    gone, came = [one for one in before if one not in now], [one for one in after if one not in known]
    words = [f"rows: {len(after)}, before: {len(before)}"]
    words += [f"{what}: {_some(names)}" for what, names in (("removed", gone), ("added", came)) if names]
    return "; ".join(words)


def _some(names: Sequence[str]) -> str:
    more = [f"and {len(names) - TOLD} more"] if len(names) > TOLD else []
    return ", ".join([*(repr(one) for one in names[:TOLD]), *more])
