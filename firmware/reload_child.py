"""Reload, in the process that reads: refuses what a running station must not take, sends the policy."""

import json
import os
import pickle
import socket
import stat
from collections.abc import Collection, Iterator, Sequence

from board.child import MAX_MESSAGE
from board.errors import ConfigurationError
from firmware.config import Config, Source
from firmware.reload import END, ERROR, FACTS, PART, ROWS
from firmware.tables import PolicyRow

# Of one message: the station makes them into tests in 0.5 ms, and takes 32 messages in a turn of its loop.
BATCH = 16
LOOK = 4096  # octets: a file that begins with so many blanks has lost its tables as well
# Tables whose loss opens a way out for what was withheld, or closes one: how they are written, and how none of them is.
NEEDED = {"interfaces": ("[interfaces]", "[interfaces]"), "policy": ("[[policy]]", "policy = [] above all tables")}
MISTAKES, LONGEST = 50, 300  # told of a file; characters of each: together they fit into a message
KINDS = {
    stat.S_IFIFO: "a pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFDIR: "a folder",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}


def serve(channel: socket.socket) -> None:
    """Read once, and stay until the station has all of it."""
    asked = channel.recv(MAX_MESSAGE)
    if not asked:
        return
    for message in answer(**json.loads(asked)):
        channel.send(message)
    channel.recv(1)


def answer(source: Sequence[object], written: Collection[str]) -> Iterator[bytes]:
    """Messages for the station.

    source   fields of a Source.
    written  tables that the files of the running configuration have.
    """
    try:
        config = read(Source(*source), written)  # type: ignore[arg-type]  # as the station has them
    except ConfigurationError as error:
        told = json.dumps([_shortened(error.message), error.hint], ensure_ascii=False)
        yield ERROR + told.encode("utf-8", "replace")
        return
    facts = {"digests": config.digests(), "written": sorted(config.written)}
    yield FACTS + json.dumps(facts).encode()
    policy = config.tables.policy
    for at in range(0, len(policy), BATCH):
        yield from _rows(policy[at : at + BATCH])
    yield END


def read(source: Source, written: Collection[str]) -> Config:
    """The configuration, where it may take the place of one with these tables. Raises ConfigurationError."""
    for path in source.files():
        _check(path)
    config = source.load()
    for name, (table, none) in NEEDED.items():
        if name in written and name not in config.written:
            raise ConfigurationError(
                f"{source.path}: {table}: missing, but the running configuration has it", f"to have none, write {none}"
            )
    return config


def _check(path: str) -> None:
    """An editor truncates a file before it writes; a full disk leaves it so. A pipe would be waited for."""
    try:
        mode = os.stat(path).st_mode
        if not stat.S_ISREG(mode):
            what = KINDS.get(stat.S_IFMT(mode), "special")
            raise ConfigurationError(f"{path}: not a regular file: {what}", "replace it by a regular file")
        with open(path, "rb") as file:
            is_empty = not file.read(LOOK).strip()
    except (OSError, ValueError):
        return  # the reader says why it cannot be read
    if is_empty:
        raise ConfigurationError(f"{path}: empty", "check free disk space and save the file again")


def _rows(rows: Sequence[PolicyRow]) -> Iterator[bytes]:
    """Some rows as one message, or as several where they are long."""
    octets = pickle.dumps(rows)
    most = MAX_MESSAGE - 1
    *first, last = [octets[at : at + most] for at in range(0, len(octets), most)]
    yield from (PART + part for part in first)
    yield ROWS + last


def _shortened(message: str) -> str:
    lines = message.split("\n")
    if len(lines) > MISTAKES:
        lines[MISTAKES:] = [f"{len(lines) - MISTAKES} more mistakes; check that this is the right file"]
    return "\n".join(line[:LONGEST] for line in lines)
