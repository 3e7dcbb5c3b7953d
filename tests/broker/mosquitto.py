"""A real broker: Debian's mosquitto on ports of its own, with TLS and client certificates, ended by its pid."""

import os
import re
import signal
import subprocess
import threading
import time
from collections import deque
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple, Self

from firmware.lab import broker
from firmware.lab.certificates import Pair
from tests.broker.certificates import Authority
from tests.system.ports import Ports

PATIENCE = 10.0  # s; reached only by a test that fails
LINES = 2000  # of its log, the last ones

# Nothing on disk, no $SYS, no Nagle; it keeps what a test's own client is slow to take.
CONFIGURATION = """
user root
persistence false
sys_interval 0
set_tcp_nodelay true
max_queued_messages 100000
log_dest stderr
log_type error
log_type warning
log_type notice
log_type information
log_type subscribe
log_timestamp false
per_listener_settings false
"""
TLS_LISTENER = """
listener {port} 127.0.0.1
cafile {authority}
certfile {server.certificate}
keyfile {server.key}
require_certificate {require}
tls_version {version}
"""
PLAIN_LISTENER = """
listener {port} 127.0.0.1
"""
BRIDGE = """
connection to-{port}
address 127.0.0.1:{port}
bridge_protocol_version mqttv50
cleansession true
notifications false
try_private true
restart_timeout 1
"""


class Bridge(NamedTuple):
    """To another broker's plain listener. topics: lines as after `topic`, such as "v2x/# both 1"."""

    port: int
    topics: Sequence[str] = ("# both 1",)


class Mosquitto:
    """A broker; not started. What is given stays as it is over a restart, the ports too.

    folder     its own: the configuration, the password file.
    server     what it shows; None: a good one of the authority.
    require_certificate  of its clients on the TLS listener.
    version    the least that TLS may be: "tlsv1.2", "tlsv1.3".
    passwords  user -> password; nobody else may connect then.
    more       further lines of its configuration.
    """

    def __init__(
        self,
        folder: Path,
        ports: Ports,
        authority: Authority,
        *,
        server: Pair | None = None,
        require_certificate: bool = True,
        version: str = "tlsv1.2",
        passwords: Mapping[str, str] | None = None,
        bridges: Sequence[Bridge] = (),
        more: str = "",
    ) -> None:
        self.port, self.plain_port = ports.take(), ports.take()
        self.authority = authority
        self.folder = folder
        self.file = folder / "mosquitto.conf"
        self._process: subprocess.Popen[bytes] | None = None
        self._log = _Log()
        tls = TLS_LISTENER.format(
            port=self.port,
            authority=authority.certificate,
            server=server or authority.server(),
            require=str(require_certificate).lower(),
            version=version,
        )
        parts = [CONFIGURATION, self._access(passwords or {}), tls, PLAIN_LISTENER.format(port=self.plain_port)]
        parts += [BRIDGE.format(port=one.port) + "".join(f"topic {row}\n" for row in one.topics) for one in bridges]
        self.file.write_text("".join([*parts, more]))

    @property
    def url(self) -> str:
        return f"mqtts://localhost:{self.port}"

    @property
    def plain_url(self) -> str:
        return f"mqtt://127.0.0.1:{self.plain_port}"

    @property
    def pid(self) -> int:
        assert self._process is not None
        return self._process.pid

    def start(self) -> Self:
        """Start it and wait until both listeners are open."""
        self._log = _Log()
        # SIGKILL: a test in a child process ends without a word.
        self._process = broker.launch(broker.mosquitto(), self.file, subprocess.PIPE, signal.SIGKILL)
        self._log.follow(self._process)
        self.says(r"mosquitto version .* running")
        return self

    def stop(self, number: int = signal.SIGTERM) -> None:
        """End it: with SIGTERM it says good bye to its clients, with SIGKILL it does not."""
        process, self._process = self._process, None
        if process is None:
            return
        process.send_signal(signal.SIGCONT)
        process.send_signal(number)
        try:
            process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            raise AssertionError("mosquitto did not end") from None
        finally:
            self._log.close()

    def kill(self) -> None:
        """The machine of the broker is gone but for its kernel, which closes what was open."""
        self.stop(signal.SIGKILL)

    def freeze(self) -> None:
        """It neither reads nor answers any more; what is connected stays so. Until thaw()."""
        os.kill(self.pid, signal.SIGSTOP)

    def thaw(self) -> None:
        os.kill(self.pid, signal.SIGCONT)

    def cpu_s(self) -> float:
        """Processor time that it has used so far."""
        return int(Path(f"/proc/{self.pid}/schedstat").read_text().split()[0]) / 1e9

    @property
    def log(self) -> list[str]:
        return self._log.lines()

    def says(self, pattern: str, count: int = 1) -> list[str]:
        """Wait until its log has at least so many lines that hold a pattern; returns them."""
        return self._log.says(pattern, count)

    def has_client(self, name: str, source: str) -> bool:
        """Wait until its log has a connection of this client from an address; names are parts of client_ids."""
        return bool(self.says(f"New client connected from {re.escape(source)}:[0-9]+ as .*{re.escape(name)}"))

    def _access(self, passwords: Mapping[str, str]) -> str:
        if not passwords:
            return "allow_anonymous true\n"
        path = self.folder / "passwords"
        path.write_text("".join(f"{user}:{word}\n" for user, word in passwords.items()))
        subprocess.run(["mosquitto_passwd", "-U", str(path)], check=True, capture_output=True)
        path.chmod(0o600)
        return f"allow_anonymous false\npassword_file {path}\n"

    def __enter__(self) -> Self:
        return self.start()

    def __exit__(self, *_: object) -> None:
        self.stop()


class _Log:
    """What it says, read by a thread, so that it never waits for us."""

    def __init__(self) -> None:
        self._lines: deque[str] = deque(maxlen=LINES)
        self._changed = threading.Condition()
        self._is_over = False
        self._thread: threading.Thread | None = None

    def follow(self, process: "subprocess.Popen[bytes]") -> None:
        self._thread = threading.Thread(target=self._read, args=(process,), daemon=True)
        self._thread.start()

    def _read(self, process: "subprocess.Popen[bytes]") -> None:
        assert process.stderr is not None
        with process.stderr as stream:
            for line in stream:
                with self._changed:
                    self._lines.append(line.decode(errors="replace").rstrip())
                    self._changed.notify_all()
        with self._changed:
            self._is_over = True
            self._changed.notify_all()

    def lines(self) -> list[str]:
        with self._changed:
            return list(self._lines)

    def says(self, pattern: str, count: int) -> list[str]:
        end = time.monotonic() + PATIENCE
        with self._changed:
            while True:
                found = [line for line in self._lines if re.search(pattern, line)]
                if len(found) >= count:
                    return found
                left = end - time.monotonic()
                said = "\n".join(self._lines)
                assert not self._is_over, f"mosquitto has ended before it said {pattern!r}:\n{said}"
                assert left > 0, f"mosquitto did not say {pattern!r} {count} times:\n{said}"
                self._changed.wait(left)

    def close(self) -> None:
        if self._thread is not None:
            self._thread.join(PATIENCE)
