"""Control socket of a local station: commands and answers as lines of JSON."""

import json
import os
import socket
import stat
import struct
import tempfile
import time
from typing import Any

from captain_client.address import Address
from captain_client.errors import RefusedError, StationError

LOCAL = ("127.0.0.1", "localhost", "::1")
MOST_OCTETS = 1 << 20  # longest answer; a status of a hundred interfaces has 100 kB
RELOAD_S = 30.0  # a reload starts processes and opens devices
COMMAND_S = 5.0  # other commands
PEER = struct.Struct("=iII")  # struct ucred of unix(7): process id, user id, group id


def path_of(address: Address, control: str) -> str:
    """Return the path of a station's control socket.

    control  path that the user gives; empty: the default path of the station's first port.

    Raises StationError if the station is on another machine, or no default path exists.
    """
    if control:
        return control
    if address.host not in LOCAL:
        raise StationError(f"{address.host} is another machine", "only a station of this machine takes commands")
    paths = default_paths(address.from_users)
    found = next((path for path in paths if os.path.exists(path)), None)
    if found is None:
        hint = "start one, or give `control`: the station's option endpoint.control"
        raise StationError(f"no station of this machine has port {address.from_users}: no {paths[0]}", hint)
    return found


def default_paths(from_users: int) -> list[str]:
    """Return the default paths of a control socket. from_users: first port of the station."""
    folders = [folder for folder in (os.environ.get("XDG_RUNTIME_DIR"), "/run/captain") if folder]
    network = os.stat("/proc/self/ns/net").st_ino
    last = f"{tempfile.gettempdir()}/captain-{os.getuid()}-{network}-{from_users}.sock"
    return [*(f"{folder}/captain-{from_users}.sock" for folder in folders), last]


def question(do: str, within_s: float, more: dict[str, object]) -> bytes:
    """Return the line of a command. within_s: seconds that the station has to complete it."""
    return json.dumps({"do": do, "within_s": within_s, **more}).encode() + b"\n"


def answer_of(path: str, line: bytes) -> dict[str, Any]:
    """Return the answer of the station. Raises RefusedError if it refuses, StationError if the line is malformed."""
    try:
        found = json.loads(line)
    except (ValueError, RecursionError):
        found = None
    if not isinstance(found, dict):
        raise StationError(f"{path}: the program that answers there is not a station: {line[:40]!r}")
    if found.get("ok") is not True:
        error = str(found.get("error", ""))
        raise RefusedError(f"the station refused the command: {error}", str(found.get("hint", "")), detail=error)
    return found


def check_peer(path: str, end: socket.socket) -> None:
    """Raise StationError if another user listens at a path where any user may create a socket."""
    if not os.stat(os.path.dirname(path) or ".").st_mode & stat.S_IWOTH:
        return
    _, user, _ = PEER.unpack(end.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, PEER.size))
    if user not in (0, os.getuid()):
        raise StationError(f"{path}: the socket belongs to user {user}, who may not run the station")


def unanswered(path: str, error: OSError) -> StationError:
    """Return the error for a control socket that cannot be opened, or does not answer in time."""
    hint = "ask as the user of the station, or as root" if isinstance(error, PermissionError) else "start the station"
    return StationError(f"{path}: no station answers: {error.strerror or error}", hint)


def exchange(path: str, line: bytes, timeout_s: float) -> bytes:
    """Send a line to a control socket, and return its answer: a line, or less if the other end closes the connection.

    Raises OSError if no program answers within timeout_s seconds, and StationError like check_peer().
    """
    deadline = time.monotonic() + timeout_s
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as end:
        end.settimeout(timeout_s)
        end.connect(path)
        check_peer(path, end)
        end.sendall(line)
        answer = b""
        while not answer.endswith(b"\n") and len(answer) <= MOST_OCTETS:
            end.settimeout(max(0.001, deadline - time.monotonic()))
            part = end.recv(1 << 16)
            if not part:
                break
            answer += part
        return answer


def ask(path: str, do: str, within_s: float = COMMAND_S, **more: object) -> dict[str, Any]:
    """Send a command to a control socket, and return the station's answer.

    Raises RefusedError if the station refuses the command, and StationError if no station answers.
    """
    try:
        answer = exchange(path, question(do, within_s, more), within_s + 1.0)
    except OSError as error:
        raise unanswered(path, error) from error
    return answer_of(path, answer)
