"""Client of a station: connects to its ports and control socket. Every wait has a time limit."""

import json
import os
import socket
import stat
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TypeAlias

import zmq

from board.runtime.errors import StationError
from captain_client import address, errors, sockets
from captain_client import control as control_socket
from captain_client.reports import object_of
from firmware import systemd

Address: TypeAlias = address.Address
Socket: TypeAlias = zmq.Socket[bytes]
Context: TypeAlias = zmq.Context[zmq.Socket[bytes]]

ANSWER_S = sockets.ANSWER_S
FOUND_S = 0.5  # time limit for a TCP connection within this machine

LOCAL = control_socket.LOCAL
OTHER = "or name another with --station HOST:PORT"
FIRST_PORT = "give the first of its four ports with --station HOST:PORT"
START_ONE = f"start one with `captain run`, or {FIRST_PORT} (`make run` has 5555 and 5565)"


def parse_report(frames: list[bytes]) -> tuple[str, dict[str, object]] | None:
    """Return topic and JSON object of a message from the report port (5558); None if it is malformed."""
    report = object_of(frames) if len(frames) == 2 else None
    return None if report is None else (frames[0].decode("ascii", "backslashreplace"), report)


# -- sockets


@contextmanager
def session() -> Iterator[Context]:
    """Yield a ZeroMQ context. At the end its sockets are closed, and unsent messages are discarded."""
    context: Context = zmq.Context()
    try:
        yield context
    finally:
        context.destroy(linger=0)


def reach(host: str, number: int, timeout: float = ANSWER_S) -> None:
    """Check that a TCP port accepts connections. Raises StationError if it does not.

    ZeroMQ itself would retry without end. timeout: seconds.
    """
    try:
        socket.create_connection((host, number), timeout).close()
    except (OSError, UnicodeError) as error:  # UnicodeError: an invalid host name
        why = getattr(error, "strerror", None) or str(error)
        is_name = isinstance(error, socket.gaierror | UnicodeError)
        hint = "check the host name" if is_name else _start_one(host)
        raise StationError(f"no station answers at {host}:{number}: {why}", hint) from error


def subscribe(context: Context, place: Address, number: int, *topics: str, url: str = "") -> Socket:
    """Return a SUB socket connected to one of the station's ports and subscribed to topics.

    url  ZeroMQ address that replaces host and port. The connection is made in the background, so a missing peer is not
         an error.

    Raises StationError if no program listens at the port.
    """
    if not url:
        reach(place.host, number)
    return _connected(context.socket(zmq.SUB), url or place.url(number), *topics)


def push(context: Context, place: Address) -> Socket:
    """Return a PUSH socket that has completed its handshake with the station's PULL socket.

    Messages sent from then on are not lost. Raises StationError if no PULL socket answers within ANSWER_S.
    """
    reach(place.host, place.pull)
    pusher = _connected(context.socket(zmq.PUSH), place.url(place.pull))
    if not pusher.poll(round(ANSWER_S * 1000), zmq.POLLOUT):
        what = f"{place.host}:{place.pull}: not the PULL port of a station"
        raise StationError(what, f"{FIRST_PORT}, or its PULL port with --pull PORT")
    return pusher


def _connected(end: Socket, url: str, *topics: str) -> Socket:
    try:
        sockets.connect(end, url, *(topic.encode() for topic in topics))
    except ValueError as error:
        end.close()
        raise StationError(str(error), "check the host name") from error
    return end


def waiting(subscriber: Socket, most: int = sockets.AT_ONCE) -> Iterator[list[bytes]]:
    """Yield the messages that have already arrived at a socket, at most `most`; never wait."""
    for _ in range(most):
        try:
            yield subscriber.recv_multipart(zmq.DONTWAIT)
        except zmq.Again:
            return


def next_report(subscriber: Socket, topic: str, timeout: float = ANSWER_S) -> dict[str, object] | None:
    """Return the next JSON object of a topic from the report port (5558); None after the timeout in seconds."""
    deadline = time.monotonic() + timeout
    while (left := deadline - time.monotonic()) > 0:
        if subscriber.poll(round(left * 1000) + 1):
            report = parse_report(subscriber.recv_multipart())
            if report is not None and report[0] == topic:
                return report[1]
    return None


# -- status and control


def ask(path: Path, do: str, timeout: float = ANSWER_S, **more: object) -> dict[str, object]:
    """Send a command (status, reload, stop, slot, ...) to a control socket and return the station's answer.

    do    name of the command.
    more  arguments of the command.

    Raises StationError if no station answers at the path, access is denied, or the station refuses the command.
    """
    question = json.dumps({"do": do, **more}).encode() + b"\n"
    try:
        return control_socket.answer_of(str(path), control_socket.exchange(str(path), question, timeout))
    except errors.RefusedError as error:
        raise StationError(_refused(do, more, error.detail), error.hint) from error
    except errors.StationError as error:
        raise StationError(error.message, _start_one()) from error
    except PermissionError as error:
        raise _forbidden(path) from error
    except OSError as error:
        why = error.strerror or str(error)
        raise StationError(f"{path}: no station answers: {why}", _start_one()) from error


def _start_one(host: str = LOCAL[0]) -> str:
    """Return the hint for a missing station: look at the installed service, or start a station with `captain run`."""
    return f"{systemd.ASK_IT}; {OTHER}" if host in LOCAL and systemd.is_installed() else START_ONE


def _refused(do: str, more: Mapping[str, object], error: str) -> str:
    """Return the message for a refused command.

    Drops the JSON key at the start of the station's error: the user of a command line did not write it.
    """
    asked = [str(more[key]) for key in ("interface", "ask", "slot") if more.get(key)]
    for key in more:
        error = error.removeprefix(f"{key}: ")
    return f"the station refused `{' '.join(asked if do == 'operate' else [do, *asked])}`: {error}"


def _forbidden(path: Path) -> StationError:
    """Return the error for denied access to a control socket.

    Names the owner of the socket, or of the first parent folder that denies access.
    """
    for place in (*reversed(path.absolute().parents), path):
        try:
            is_open = os.access(place, os.W_OK if place == path else os.X_OK)
            found = place.stat()
        except OSError:
            break
        if not is_open:
            user, group = _name(place.owner, found.st_uid), _name(place.group, found.st_gid)
            what = f"{place} is of user {user}, group {group}, mode {stat.S_IMODE(found.st_mode):04o}"
            return StationError(f"{path}: permission denied: {what}", f"ask as user {user}, or as root by sudo")
    return StationError(f"{path}: permission denied", "ask as the user of the station, or as root by sudo")


def _name(look: Callable[[], str], number: int) -> str:
    """Return the name of a user or group, or its number if it has no name."""
    try:
        return look()
    except KeyError:
        return str(number)


def ask_local(place: Address, control: str, do: str, timeout: float = ANSWER_S, **more: object) -> dict[str, object]:
    """Send a command to a station of this machine by ask(), and return the answer.

    control  path of the control socket; empty: the default path that belongs to the station's first port.
    timeout  seconds that the station has to complete the command; ask() waits one second longer.

    Raises StationError if the host is another machine, and like ask().
    """
    if place.host not in LOCAL:
        raise StationError(f"{place.host} is another machine", "log in there: only a local station takes commands")
    paths = [control] if control else list(filter(os.path.exists, control_socket.default_paths(place.from_users)))
    if not paths:
        raise _not_found(place)
    return ask(Path(paths[0]), do, timeout + 1.0, within_s=timeout, **more)


def _not_found(place: Address) -> StationError:
    """Return the error for missing default control sockets: the station uses another path, or does not run."""
    try:
        reach(place.host, place.from_users, FOUND_S)
    except StationError:
        return StationError(f"no station of this machine has port {place.from_users}", _start_one())
    return StationError(
        f"a station may be at port {place.from_users}, but its control socket has none of the default paths",
        "give its path with --control PATH; it is the station's option endpoint.control",
    )


def status(place: Address, control: str = "", timeout: float = ANSWER_S) -> dict[str, object]:
    """Return a station's status, from its control socket on this machine, otherwise from its report port.

    Raises StationError with a remedy if no answer comes within the timeout in seconds.
    """
    if control:
        return station_status(Path(control), timeout)
    for path in control_socket.default_paths(place.from_users) if place.host in LOCAL else ():
        try:
            return station_status(Path(path), timeout)
        except StationError:
            continue  # the report port is tried next, and its error says more
    with session() as context, subscribe(context, place, place.report, "status.") as subscriber:
        report = next_report(subscriber, "status.", timeout)
    if report is None:
        raise StationError(
            f"{place.host}:{place.report}: no status within {timeout:g} s",
            f"{FIRST_PORT}, or its report port with --report PORT",
        )
    return report


def station_status(path: Path, timeout: float = ANSWER_S) -> dict[str, object]:
    """Return the status of the station with this control socket.

    Raises StationError like ask(), and if the answer contains no status.
    """
    found = ask(path, "status", timeout).get("status")
    if not isinstance(found, dict):
        raise StationError(f"{path}: the answer holds no status", "check the version of the station")
    return found
