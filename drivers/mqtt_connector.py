"""One try to reach a broker: name, TCP and TLS block, so a thread does them and wakes the loop when it has ended."""

import os
import socket
import time
from contextlib import suppress
from threading import Lock, Thread

from board.errors import InterfaceError
from drivers import mqtt_credentials, mqtt_trouble
from drivers.mqtt_broker import broker, is_loopback
from drivers.mqtt_settings import MqttSettings

# Look-ups that hang cannot be ended: the C library gives up after half a minute. So many are waited for.
MOST_HANGING = 4

# What the kernel keeps of what is written, twice that by its own count, and how much of it may not have left yet: a
# slow network has it in seconds, and what waits behind it waits where it has a lifetime.
SEND_BUFFER = 8192  # octets
UNSENT = 1024

# A connection that nobody waits for any more goes on for no longer than this.
LEAST_S = 0.5


class Connector:
    """One try.

    device     of the bearer: the connection is bound to it where the settings name none and the broker is elsewhere.
    waits_for  what it lacks, in words.
    socket     the connection, not blocking, when it has ended well. why_not: it has not; empty before.
    is_away    why_not is that this machine has no network.
    """

    _hanging = 0  # look-ups of earlier tries, in all
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
            self._end(None, f"{MOST_HANGING} look-ups of its name hang; is the name server there?")
        else:
            Thread(target=self._run, daemon=True).start()

    def fileno(self) -> int:
        """Readable as soon as it has ended."""
        return self._wake

    def close(self) -> None:
        """Nobody waits for it any more: what it reaches later is closed. The socket of one that has ended is kept."""
        with Connector._lock:
            self._is_abandoned = True
            os.close(self._wake)

    def _run(self) -> None:
        stage = _Stage()
        try:
            found = self._reach(stage)
        except (OSError, InterfaceError, ValueError) as error:  # ValueError: a name that no certificate can have
            self.is_away = mqtt_trouble.is_away(error)
            self._end(None, self._why(error, stage))
        else:
            self._end(found, "")

    def _why(self, error: Exception, stage: "_Stage") -> str:
        if isinstance(error, TimeoutError) and error.errno is None:  # ours, not the kernel's
            return f"{self.waits_for} within {self._settings.connect_s:g} s"
        where = f"{stage.address}: " if stage.address and not stage.is_handshake else ""
        return where + mqtt_trouble.why(error, stage.is_handshake)

    def _reach(self, stage: "_Stage") -> socket.socket:
        settings = self._settings
        end = time.monotonic() + settings.connect_s
        context = mqtt_credentials.context(settings) if self._broker.has_tls else None
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
        """The first address that answers; each has a share of the time that is left."""
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
                # What was written and stays unacknowledged ends it, after a quarter of an hour otherwise (tcp(7)).
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
    """What goes by another device is not of this bearer. Raises InterfaceError, with what to do."""
    try:
        made.setsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, device.encode())
    except PermissionError as error:
        hint = "give the station CAP_NET_RAW: AmbientCapabilities= of its service"
        raise InterfaceError(f"this user may not bind a connection to {device}", hint) from error
    except OSError as error:
        raise InterfaceError(f"device {device}: {error.strerror}", "`ip -brief link` lists them") from error


class _Stage:
    """How far a try has come: the address, and whether TCP stands."""

    def __init__(self) -> None:
        self.address = ""
        self.is_handshake = False
