"""Child process of reload: reads the configuration, checks it, sends the policy."""

import json
import os
import pickle
import socket
import stat
from collections.abc import Collection, Iterator, Sequence

from board.runtime.child import MAX_MESSAGE
from board.runtime.errors import ConfigurationError
from firmware.config.captain_toml import Config, ConfigSource
from firmware.config.reload import END, ERROR, FACTS, PART, ROWS
from firmware.config.tables import PolicyRow

# Number of rows per message. The station compiles them in 0.5 ms, and takes 32 messages per turn of its loop.
BATCH = 16
LOOK = 4096  # number of octets at the beginning of a file that are read: if all are white space, its contents are lost
# Tables that must not disappear unnoticed, because they decide which messages leave. For each: its notation, and the
# notation of an empty table.
NEEDED = {"interfaces": ("[interfaces]", "[interfaces]"), "policy": ("[[policy]]", "policy = [] above all tables")}
MISTAKES, LONGEST = 50, 300  # limits of an error message: mistakes, and characters of each. It fits into one message.
KINDS = {
    stat.S_IFIFO: "a pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFDIR: "a folder",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}
# Paths of streams: `captain demo` and `captain lab` give the board file to a station by its standard input.
STREAMS = ("/dev/stdin", "/dev/fd/", "/proc/self/fd/")
OF_STREAM = (
    "the station read it once, at its start, and has no file to reload; start it with --config FILE or --board FILE"
)


def serve(channel: socket.socket) -> None:
    """Receive one question, send all messages of the answer, and wait until the station has received them."""
    asked = channel.recv(MAX_MESSAGE)
    if not asked:
        return
    for message in answer(**json.loads(asked)):
        channel.send(message)
    channel.recv(1)


def answer(source: Sequence[object], written: Collection[str]) -> Iterator[bytes]:
    """Read the configuration and yield the messages for the station: facts and rows, or an error.

    source   fields of a ConfigSource.
    written  names of the tables in the files of the running configuration.
    """
    try:
        config = read(ConfigSource(*source), written)  # type: ignore[arg-type]  # fields of the station's own source
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


def read(source: ConfigSource, written: Collection[str]) -> Config:
    """Read the configuration and check that it may replace the running one.

    written  names of the tables in the files of the running configuration.

    Raises ConfigurationError if a file is empty, not regular or invalid, or if it lacks a table in NEEDED that the
    running configuration has.
    """
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
    """Check that a file is a regular file with contents. Raises ConfigurationError otherwise.

    An editor leaves an empty file if the disk is full. A pipe would block the reader.
    """
    try:
        mode = os.stat(path).st_mode
        if not stat.S_ISREG(mode):
            what = KINDS.get(stat.S_IFMT(mode), "special")
            remedy = OF_STREAM if path.startswith(STREAMS) else "replace it by a regular file"
            raise ConfigurationError(f"{path}: not a regular file: {what}", remedy)
        with open(path, "rb") as file:
            is_empty = not file.read(LOOK).strip()
    except (OSError, ValueError):
        return  # load() reports the error
    if is_empty:
        raise ConfigurationError(f"{path}: empty", "check free disk space and save the file again")


def _rows(rows: Sequence[PolicyRow]) -> Iterator[bytes]:
    """Yield a group of rows as one message, or as several if it exceeds MAX_MESSAGE."""
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
