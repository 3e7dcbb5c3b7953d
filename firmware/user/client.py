"""A user's side of a station: its addresses, its control socket, its sockets; every wait has a bound."""

import argparse
import json
import os
import socket
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple, TypeAlias

import zmq

from board.errors import StationError

# A heartbeat and a status come once a second: three of them lost is nobody there.
ANSWER_S = 3.0
# A status of a station with a hundred interfaces has 100 KB; a peer that sends more is not a station.
MAX_ANSWER = 1 << 20  # octets
# Messages that libzmq keeps for a user who reads late: 10 s at 1,000 a second.
HIGH_WATER = 10_000

Socket: TypeAlias = zmq.Socket[bytes]
Context: TypeAlias = zmq.Context[zmq.Socket[bytes]]

LOCAL = ("127.0.0.1", "localhost", "::1")
START_ONE = "start one with `captain run`, or name another with --station HOST:PORT"


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


# -- addresses on the command line


def arguments(parser: argparse.ArgumentParser) -> None:
    """The options by which every command names its station."""
    group = parser.add_argument_group("the station")
    group.add_argument(
        "--station",
        metavar="HOST[:PORT]",
        type=station,
        default=("127.0.0.1", 5555),
        help="its host and the port that users publish to (default 127.0.0.1:5555); the others follow: "
        "+1 to users, +2 PULL, +3 reports",
    )
    group.add_argument("--to-users", metavar="PORT", type=port, help="another port for users' SUB sockets")
    group.add_argument("--pull", metavar="PORT", type=port, help="another port for users' PUSH sockets")
    group.add_argument("--report", metavar="PORT", type=port, help="another port for status and confirms")


def address(options: argparse.Namespace) -> Address:
    """The address that the options of arguments() name."""
    host, first = options.station
    return Address(host, first, options.to_users or first + 1, options.pull or first + 2, options.report or first + 3)


def station(text: str) -> tuple[str, int]:
    """Host and port of `HOST`, `HOST:PORT`, `:PORT`, `[V6]:PORT`. Raises ArgumentTypeError."""
    if text.startswith("["):
        host, _, rest = text[1:].partition("]")
        number = rest.removeprefix(":")
    elif text.count(":") > 1:
        host, number = text, ""
    else:
        host, _, number = text.partition(":")
    first = port(number) if number else 5555
    if first + 3 > 0xFFFF:
        raise argparse.ArgumentTypeError(f"{text!r}: the three ports after {first} do not exist")
    return host or "127.0.0.1", first


def port(text: str) -> int:
    """A TCP port. Raises ArgumentTypeError."""
    if not (text.isascii() and text.isdigit() and 1 <= int(text) <= 0xFFFF):
        raise argparse.ArgumentTypeError(f"{text!r} is no port: 1 ... 65535")
    return int(text)


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
        raise StationError(f"no station answers at {host}:{number}: {why}", START_ONE) from error


def subscribe(context: Context, place: Address, number: int, *topics: str) -> Socket:
    """A SUB socket connected to one of the station's ports. Raises StationError when nobody listens there."""
    reach(place.host, number)
    subscriber = context.socket(zmq.SUB)
    subscriber.setsockopt(zmq.RCVHWM, HIGH_WATER)
    return _connect(subscriber, place, number, topics)


def push(context: Context, place: Address) -> Socket:
    """A PUSH socket to the station's PULL, connected when this returns: nothing sent to it is lost."""
    reach(place.host, place.pull)
    pusher = context.socket(zmq.PUSH)
    pusher.setsockopt(zmq.IMMEDIATE, 1)  # takes messages only when the handshake is done
    _connect(pusher, place, place.pull, ())
    if not pusher.poll(round(ANSWER_S * 1000), zmq.POLLOUT):
        raise StationError(
            f"what listens at {place.host}:{place.pull} is not a station's PULL", "name its port with --pull"
        )
    return pusher


def _connect(end: Socket, place: Address, number: int, topics: tuple[str, ...]) -> Socket:
    end.setsockopt(zmq.MAXMSGSIZE, MAX_ANSWER)
    end.setsockopt(zmq.IPV6, 1)
    for topic in topics:
        end.setsockopt(zmq.SUBSCRIBE, topic.encode())
    end.connect(place.url(number))
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


def control_paths(from_users: int) -> list[Path]:
    """Where a station of this machine may have its control socket: firmware/control_socket.py has the choice."""
    name = f"captain-{from_users}.sock"
    folders = [folder for folder in (os.environ.get("XDG_RUNTIME_DIR"), "/run/captain") if folder]
    nowhere_else = Path(tempfile.gettempdir()) / f"captain-{os.getuid()}-{from_users}.sock"
    return [*(Path(folder) / name for folder in folders), nowhere_else]


def ask(path: Path, do: str, timeout: float = ANSWER_S) -> dict[str, object]:
    """Ask a station over its control socket: status, reload or stop. Raises StationError."""
    try:
        line = _ask(path, json.dumps({"do": do}).encode() + b"\n", time.monotonic() + timeout)
        answer = json.loads(line)
    except OSError as error:
        why = error.strerror or str(error)
        raise StationError(f"{path}: no station answers: {why}", START_ONE) from error
    except (ValueError, RecursionError) as error:
        raise StationError(f"{path}: what answers there is not a station: {error}", START_ONE) from error
    if not isinstance(answer, dict):
        raise StationError(f"{path}: what answers there is not a station: {line[:40]!r}", START_ONE)
    if answer.get("ok") is not True:
        raise StationError(f"the station refused {do}: {answer.get('error', '')}", str(answer.get("hint", "")))
    return answer


def _ask(path: Path, question: bytes, deadline: float) -> bytes:
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as end:
        end.settimeout(max(0.001, deadline - time.monotonic()))
        end.connect(str(path))
        end.sendall(question)
        line = b""
        while not line.endswith(b"\n"):
            end.settimeout(max(0.001, deadline - time.monotonic()))
            part = end.recv(1 << 16)
            if not part or len(line) > MAX_ANSWER:
                raise ValueError(f"{len(line)} octets without an end of line")
            line += part
        return line


def status(place: Address, control: str = "", timeout: float = ANSWER_S) -> dict[str, object]:
    """A station's status: by its control socket when it is on this machine, else by what it reports.

    Raises StationError with a remedy when nobody answers in time.
    """
    if control:
        return station_status(Path(control), timeout)
    for path in control_paths(place.from_users) if place.host in LOCAL else ():
        try:
            return station_status(path, timeout)
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
