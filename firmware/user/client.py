"""A user's side of a station: its addresses, its control socket, its sockets; every wait has a bound."""

import json
import os
import socket
import stat
import struct
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple, TypeAlias

import zmq

from board.errors import StationError
from firmware.control_socket import default_paths
from firmware.user import systemd

# A heartbeat and a status come once a second: three of them lost is nobody there.
ANSWER_S = 3.0
FOUND_S = 0.5  # for this machine to take a connection
# A status of a station with a hundred interfaces has 100 KB; a peer that sends more is not a station.
MAX_ANSWER = 1 << 20  # octets
# Messages that libzmq keeps for a user who reads late: 10 s at 1,000 a second.
HIGH_WATER = 10_000
# A machine that loses its power or its network ends no connection: ZMTP's own heartbeats do, at both ends.
HEARTBEAT_MS, HEARTBEAT_TIMEOUT_MS = 1_000, 3_000

Socket: TypeAlias = zmq.Socket[bytes]
Context: TypeAlias = zmq.Context[zmq.Socket[bytes]]

PEER = struct.Struct("=iII")  # struct ucred: process, user, group

LOCAL = ("127.0.0.1", "localhost", "::1")
OTHER = "or name another with --station HOST:PORT"
START_ONE = f"start one with `captain run`, {OTHER}"


class Address(NamedTuple):
    """Where a station's endpoint is: a host and the four ports of CONTRACT section 1 and of the README."""

    host: str = "127.0.0.1"
    from_users: int = 5555
    to_users: int = 5556
    pull: int = 5557
    report: int = 5558

    def url(self, port: int) -> str:
        """ZeroMQ address of one of the ports."""
        return f"tcp://[{self.host}]:{port}" if ":" in self.host else f"tcp://{self.host}:{port}"


def parse_report(frames: list[bytes]) -> tuple[str, dict[str, object]] | None:
    """Topic and JSON object of a message of 5558; None for rubbish."""
    if len(frames) != 2:
        return None
    try:
        answer = json.loads(frames[1])
    except (ValueError, RecursionError):
        return None
    return (frames[0].decode("ascii", "backslashreplace"), answer) if isinstance(answer, dict) else None


# -- sockets


@contextmanager
def session() -> Iterator[Context]:
    """A ZeroMQ context whose sockets are closed at the end without waiting for anybody."""
    context: Context = zmq.Context()
    try:
        yield context
    finally:
        context.destroy(linger=0)


def reach(host: str, number: int, timeout: float = ANSWER_S) -> None:
    """Raise StationError unless something accepts TCP connections there: ZeroMQ itself would try for ever."""
    try:
        socket.create_connection((host, number), timeout).close()
    except (OSError, UnicodeError) as error:  # UnicodeError: a name that DNS cannot have
        why = getattr(error, "strerror", None) or str(error)
        raise StationError(f"no station answers at {host}:{number}: {why}", _start_one(host)) from error


def subscribe(context: Context, place: Address, number: int, *topics: str, url: str = "") -> Socket:
    """A SUB socket connected to one of the station's ports. Raises StationError when nobody listens there.

    url  ZeroMQ address to connect to in its place, in the background, whether or not anybody listens.
    """
    if not url:
        reach(place.host, number)
    subscriber = context.socket(zmq.SUB)
    subscriber.setsockopt(zmq.RCVHWM, HIGH_WATER)
    return _connect(subscriber, url or place.url(number), topics)


def push(context: Context, place: Address) -> Socket:
    """A PUSH socket to the station's PULL, connected when this returns: nothing sent to it is lost."""
    reach(place.host, place.pull)
    pusher = context.socket(zmq.PUSH)
    pusher.setsockopt(zmq.IMMEDIATE, 1)  # takes messages only when the handshake is done
    _connect(pusher, place.url(place.pull), ())
    if not pusher.poll(round(ANSWER_S * 1000), zmq.POLLOUT):
        raise StationError(
            f"what listens at {place.host}:{place.pull} is not a station's PULL", "name its port with --pull"
        )
    return pusher


def _connect(end: Socket, url: str, topics: tuple[str, ...]) -> Socket:
    end.setsockopt(zmq.MAXMSGSIZE, MAX_ANSWER)
    end.setsockopt(zmq.IPV6, 1)
    end.setsockopt(zmq.HEARTBEAT_IVL, HEARTBEAT_MS)
    end.setsockopt(zmq.HEARTBEAT_TIMEOUT, HEARTBEAT_TIMEOUT_MS)
    end.setsockopt(zmq.HEARTBEAT_TTL, HEARTBEAT_TIMEOUT_MS)
    for topic in topics:
        end.setsockopt(zmq.SUBSCRIBE, topic.encode())
    end.connect(url)
    return end


def waiting(subscriber: Socket, most: int = 256) -> Iterator[list[bytes]]:
    """The messages that wait in a socket, at most so many."""
    for _ in range(most):
        try:
            yield subscriber.recv_multipart(zmq.DONTWAIT)
        except zmq.Again:
            return


def next_report(subscriber: Socket, topic: str, timeout: float = ANSWER_S) -> dict[str, object] | None:
    """The next JSON object under a topic of 5558, skipping the rest; None when none came in time."""
    deadline = time.monotonic() + timeout
    while (left := deadline - time.monotonic()) > 0:
        if subscriber.poll(round(left * 1000) + 1):
            report = parse_report(subscriber.recv_multipart())
            if report is not None and report[0] == topic:
                return report[1]
    return None


# -- status and control


def ask(path: Path, do: str, timeout: float = ANSWER_S, **more: object) -> dict[str, object]:
    """Ask a station over its control socket: status, reload, stop, slot, ...; more is the rest of the question.

    Raises StationError.
    """
    try:
        line = _ask(path, json.dumps({"do": do, **more}).encode() + b"\n", time.monotonic() + timeout)
        answer = json.loads(line)
    except PermissionError as error:
        raise _forbidden(path) from error
    except OSError as error:
        why = error.strerror or str(error)
        raise StationError(f"{path}: no station answers: {why}", _start_one()) from error
    except (ValueError, RecursionError) as error:
        raise StationError(f"{path}: what answers there is not a station: {error}", _start_one()) from error
    if not isinstance(answer, dict):
        raise StationError(f"{path}: what answers there is not a station: {line[:40]!r}", _start_one())
    if answer.get("ok") is not True:
        raise StationError(_refused(do, more, str(answer.get("error", ""))), str(answer.get("hint", "")))
    return answer


def _start_one(host: str = LOCAL[0]) -> str:
    """What to do where no station answers; where it is a service, a second one is no help."""
    return f"{systemd.ASK_IT}; {OTHER}" if host in LOCAL and systemd.is_installed() else START_ONE


def _refused(do: str, more: Mapping[str, object], error: str) -> str:
    """A refusal in the words of a command line: a key of the question in front of it says nothing there."""
    asked = [str(more[key]) for key in ("interface", "ask", "slot") if more.get(key)]
    for key in more:
        error = error.removeprefix(f"{key}: ")
    return f"the station refused `{' '.join(asked if do == 'operate' else [do, *asked])}`: {error}"


def _forbidden(path: Path) -> StationError:
    """Whose the socket is, or the first folder on the way that lets nobody else through."""
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
    """Name of a user or group, or its number where it has none."""
    try:
        return look()
    except KeyError:
        return str(number)


def _ask(path: Path, question: bytes, deadline: float) -> bytes:
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as end:
        end.settimeout(max(0.001, deadline - time.monotonic()))
        end.connect(str(path))
        if path.parent.stat().st_mode & stat.S_IWOTH and (user := _peer_user(end)) not in (0, os.getuid()):
            raise StationError(f"{path}: user {user} listens there, who may be anybody", _start_one())
        end.sendall(question)
        line = b""
        while not line.endswith(b"\n"):
            end.settimeout(max(0.001, deadline - time.monotonic()))
            part = end.recv(1 << 16)
            if not part or len(line) > MAX_ANSWER:
                raise ValueError(f"{len(line)} octets without an end of line")
            line += part
        return line


def _peer_user(end: socket.socket) -> int:
    """Numerical id of the user who listens at the other end: SO_PEERCRED of unix(7)."""
    credentials = end.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, PEER.size)
    return int(PEER.unpack(credentials)[1])


def ask_local(place: Address, control: str, do: str, timeout: float = ANSWER_S, **more: object) -> dict[str, object]:
    """ask() the station of this machine, at its control socket or where it listens by its first port.

    Its answer is waited for as long as that of a question that may be answered later. Raises StationError.
    """
    if place.host not in LOCAL:
        raise StationError(f"{place.host} is another machine", "log in there: only a local station takes commands")
    paths = [control] if control else [path for path in default_paths(place.from_users) if os.path.exists(path)]
    if not paths:
        raise _not_found(place)
    return ask(Path(paths[0]), do, timeout + 1.0, within_s=timeout, **more)


def _not_found(place: Address) -> StationError:
    """Why none of the usual control sockets is there: another one is used, or nobody runs."""
    try:
        reach(place.host, place.from_users, FOUND_S)
    except StationError:
        return StationError(f"no station of this machine has port {place.from_users}", _start_one())
    return StationError(
        f"a station may be at port {place.from_users}, but its control socket is at none of the usual places",
        "name it with --control PATH: its option endpoint.control",
    )


def status(place: Address, control: str = "", timeout: float = ANSWER_S) -> dict[str, object]:
    """A station's status: by its control socket when it is on this machine, else by what it reports.

    Raises StationError with a remedy when nobody answers in time.
    """
    if control:
        return station_status(Path(control), timeout)
    for path in default_paths(place.from_users) if place.host in LOCAL else ():
        try:
            return station_status(Path(path), timeout)
        except StationError:
            continue  # the report port says what is wrong, if anything is
    with session() as context, subscribe(context, place, place.report, "status.") as subscriber:
        report = next_report(subscriber, "status.", timeout)
    if report is None:
        raise StationError(
            f"what listens at {place.host}:{place.report} sent no status within {timeout:g} s",
            "is that a station's report port? name it with --report PORT",
        )
    return report


def station_status(path: Path, timeout: float = ANSWER_S) -> dict[str, object]:
    """The status of the station with this control socket. Raises StationError."""
    found = ask(path, "status", timeout).get("status")
    if not isinstance(found, dict):
        raise StationError(f"{path}: the answer holds no status", "is the station of another version?")
    return found
