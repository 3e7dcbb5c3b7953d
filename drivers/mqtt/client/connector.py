"""One try to connect to a broker. Name look-up, TCP and TLS block, so a thread executes them and wakes the loop."""

import os
import socket
import time
from contextlib import suppress
from threading import Lock, Thread

from board.runtime.errors import InterfaceError
from drivers.mqtt.broker import broker, is_loopback
from drivers.mqtt.client import credentials, trouble
from drivers.mqtt.client.settings import MqttSettings

# Most name look-ups that hang at the same time. A look-up cannot be cancelled: the C library gives up after half a
# minute.
MOST_HANGING = 4

# Send buffer in the kernel, which doubles it, and most unsent octets in it (TCP_NOTSENT_LOWAT). Both are small, so that
# even a slow network sends them within seconds. Other messages wait in queues where their lifetime is checked.
SEND_BUFFER = 8192  # octets
UNSENT = 1024

# Least time limit of connect() and of the TLS handshake, also if the time of the try is used up.
LEAST_S = 0.5


class Connector:
    """One try to connect.

    device     network device of the bearer. The connection is bound to it if the settings name no device and the
               broker is not on this machine.
    waits_for  missing step in words, such as "no answer to SYN from ...".
    socket     non-blocking connection after success; None before, and after a failure.
    why_not    reason of a failure in words; empty before the end, and after success.
    is_away    True if the failure is that this machine has no network.
    """

    _hanging = 0  # number of look-ups in progress, of all tries
    _lock = Lock()

    def __init__(self, settings: MqttSettings, device: str = "") -> None:
        self.waits_for = "no answer from the name server"
        self.socket: socket.socket | None = None
        self.why_not = ""
        self.is_away = False
        self._settings = settings
        self._device = device
        self._broker = broker(settings.url)
        self._is_abandoned = False
        self._wake = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        if Connector._hanging >= MOST_HANGING:
            self._end(None, f"{MOST_HANGING} look-ups of the broker's name have no answer yet; check the name server")
        else:
            Thread(target=self._run, daemon=True).start()

    def fileno(self) -> int:
        """Return a descriptor that becomes readable when the try has ended."""
        return self._wake

    def close(self) -> None:
        """Abandon the try: a connection made later is closed. If the try has already ended, its socket stays open."""
        with Connector._lock:
            self._is_abandoned = True
            os.close(self._wake)

    def _run(self) -> None:
        stage = _Stage()
        try:
            found = self._reach(stage)
        except (OSError, InterfaceError, ValueError) as error:  # ValueError: a host name that is invalid for TLS
            self.is_away = trouble.is_away(error)
            self._end(None, self._why(error, stage))
        else:
            self._end(found, "")

    def _why(self, error: Exception, stage: "_Stage") -> str:
        if isinstance(error, TimeoutError) and error.errno is None:  # timeout of Python's socket, not of the kernel
            return f"{self.waits_for} within {self._settings.connect_s:g} s"
        where = f"{stage.address}: " if stage.address and not stage.is_handshake else ""
        return where + trouble.why(error, stage.is_handshake)

    def _reach(self, stage: "_Stage") -> socket.socket:
        settings = self._settings
        end = time.monotonic() + settings.connect_s
        context = credentials.context(settings) if self._broker.has_tls else None
        addresses = self._look_up()
        raw = self._connect(addresses, end, stage)
        if context is None:
            raw.setblocking(False)
            return raw
        stage.is_handshake = True
        self.waits_for = f"no end of the TLS handshake with {stage.address}"
        raw.settimeout(max(LEAST_S, end - time.monotonic()))
        try:
            secure = context.wrap_socket(raw, server_hostname=self._broker.host)
        except BaseException:
            raw.close()
            raise
        secure.setblocking(False)
        return secure

    def _look_up(self) -> list[tuple[socket.AddressFamily, tuple[str, int]]]:
        with Connector._lock:
            Connector._hanging += 1
        try:
            found = socket.getaddrinfo(self._broker.host, self._broker.port, type=socket.SOCK_STREAM)
        except UnicodeError as error:
            raise socket.gaierror(socket.EAI_NONAME, "no name") from error
        finally:
            with Connector._lock:
                Connector._hanging -= 1
        return [(family, address) for family, _, _, _, address in found]  # type: ignore[misc] # AF_INET6 has more

    def _connect(
        self, addresses: list[tuple[socket.AddressFamily, tuple[str, int]]], end: float, stage: "_Stage"
    ) -> socket.socket:
        """Return a connection to the first address that answers; each address gets a share of the time left."""
        failure: OSError = TimeoutError()
        for place, (family, address) in enumerate(addresses):
            if self._is_abandoned:
                break
            stage.address = address[0]
            self.waits_for = f"no answer to SYN from {address[0]}"
            share = (end - time.monotonic()) / (len(addresses) - place)
            made = socket.socket(family, socket.SOCK_STREAM)
            try:
                if device := self._settings.device or (self._device if not is_loopback(address[0]) else ""):
                    _bind(made, device)
                made.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                made.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
                made.setsockopt(socket.IPPROTO_TCP, socket.TCP_NOTSENT_LOWAT, UNSENT)
                made.settimeout(max(LEAST_S, share))
                made.connect(address)
            except OSError as error:
                made.close()
                failure = error
            except InterfaceError:
                made.close()
                raise
            else:
                # Octets that stay unacknowledged for stall_s end the connection. By default that takes a quarter of an
                # hour (tcp(7)).
                made.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, int(1000 * self._settings.stall_s))
                return made
        raise failure

    def _end(self, found: socket.socket | None, why_not: str) -> None:
        with Connector._lock:
            if self._is_abandoned:
                if found is not None:
                    with suppress(OSError):
                        found.close()
                return
            self.socket, self.why_not = found, why_not
            os.eventfd_write(self._wake, 1)


def _bind(made: socket.socket, device: str) -> None:
    """Bind a socket to a network device, so that it does not use another one. Raises InterfaceError with a remedy."""
    try:
        made.setsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, device.encode())
    except PermissionError as error:
        hint = "give the station CAP_NET_RAW: AmbientCapabilities= of its service"
        raise InterfaceError(f"the station's user may not bind connections to network device {device}", hint) from error
    except OSError as error:
        raise InterfaceError(f"device {device}: {error.strerror}", "`ip -brief link` lists them") from error


class _Stage:
    """Progress of a try.

    address       IP address that is tried; empty during the name look-up.
    is_handshake  True after TCP has connected, during the TLS handshake.
    """

    def __init__(self) -> None:
        self.address = ""
        self.is_handshake = False
