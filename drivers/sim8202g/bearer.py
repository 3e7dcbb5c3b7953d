"""Bearers: paths of packets from the modem to a network device of this machine.

A bearer has one script to bring it up and one to take it down. For qmi and mbim, tests compare the command lines and
parse sample output of qmicli and mbimcli. They have not been tested with a module, which these programs need.
Sources: man qmicli(1), mbimcli(1), udhcpc of busybox; AT command manual of the SIM82xx V1.02 ($QCRMCALL).
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from pathlib import Path

from board.runtime.errors import InterfaceError
from drivers.sim8202g.options import ModemOptions
from drivers.sim8202g.printed import ADDRESS, CLIENT, HANDLE, LEASE, Settings, mbim_settings, qmi_settings, value
from drivers.sim8202g.script import LostError, Pause, Script, StepError, ask, lines, run
from drivers.sim8202g.session import Session, SessionFile
from drivers.sim8202g.system import System
from drivers.wire.at.answers import addresses, is_active

DEVICE_TRIES = 15  # look-ups of the network device, one per second

CONNECT_S = 60.0  # time limit for a network to set up a packet context; most networks need 1 s


class Bearer(ABC):
    """Base class of bearers.

    device  name of the network device; empty while unknown, and for a bearer without one.
    """

    def __init__(self, options: ModemOptions, system: System) -> None:
        self._options = options
        self._system = system
        self.device = ""

    @abstractmethod
    def up(self) -> Script[None]:
        """Bring the bearer up. Raises StationError if a step fails."""

    @abstractmethod
    def down(self) -> Script[None]:
        """Take the bearer down from any state."""

    def look(self) -> Script[tuple[str, ...]]:
        """Return the addresses of the network device. Raises LostError if it has none.

        A program queries them, so that the loop does not block. The kernel answers under its lock of all network
        devices, which another process that takes a device down may hold for seconds.
        """
        found = ADDRESS.findall((yield from run("ip", "-o", "addr", "show", "dev", self.device, "scope", "global")))
        if not found:
            raise LostError(f"{self.device} has no address any more")
        return tuple(found)

    def leave(self) -> list[tuple[str, ...]]:
        """Return command lines that end the bearer as far as possible without waiting for their results."""
        return [("ip", "addr", "flush", "dev", self.device)] if self.device else []

    def find_device(self) -> Script[None]:
        """Wait for the network device, whose kernel driver starts after that of the serial ports.

        Raises InterfaceError if it does not appear within DEVICE_TRIES look-ups.
        """
        self.device = self._options.device
        for tries in range(DEVICE_TRIES if not self.device else 0):
            try:
                self.device = self._system.network_device(self._options.usb)
            except InterfaceError:
                if tries == DEVICE_TRIES - 1:
                    raise
                yield Pause(1.0)
            else:
                return

    def _configure(self, settings: Settings) -> Script[None]:
        """Configure the network device with the address, gateway and MTU that the network assigned."""
        yield from run("ip", "link", "set", "dev", self.device, "up", "mtu", str(settings.mtu))
        yield from run("ip", "addr", "flush", "dev", self.device)
        yield from run("ip", "addr", "add", settings.address, "dev", self.device)
        way = ("via", settings.gateway) if settings.gateway else ()
        version = "-6" if ":" in settings.address else "-4"
        metric = str(self._options.metric)
        yield from run("ip", version, "route", "replace", "default", *way, "dev", self.device, "metric", metric)

    def _clear(self) -> Script[None]:
        if self.device:
            yield from _tolerated(run("ip", "addr", "flush", "dev", self.device))


class Qmi(Bearer):
    """Bearer by qmicli. It uses qmi-proxy, so that the QMI client of the connection survives between calls."""

    def __init__(self, options: ModemOptions, system: System) -> None:
        super().__init__(options, system)
        self._control: tuple[str, ...] = ()
        self._file = SessionFile(Path(options.state_dir) / f"{options.usb}-qmi.json")
        self._session = self._file.load()  # session left open by a station that ended without stop()

    def up(self) -> Script[None]:
        yield from self.find_device()
        self._control = ("qmicli", f"--device={self._system.control_device(self._options.usb)}", "--device-open-proxy")
        yield from self._end()
        yield from run("ip", "link", "set", "dev", self.device, "down")
        yield from run(*self._control, "--set-expected-data-format=raw-ip")
        yield from run("ip", "link", "set", "dev", self.device, "up")
        # The client is allocated before the network is started. If one call did both and failed, its output would not
        # name the client, which could then not be released.
        printed = yield from run(*self._control, "--wds-noop", "--client-no-release-cid")
        session = Session(value(CLIENT, printed, "qmicli"))
        self._keep(session)
        version = "6" if self._options.ip_type == "ipv6" else "4"
        network = f"apn='{self._options.apn}',ip-type={version}" if self._options.apn else f"ip-type={version}"
        printed = yield from run(
            *self._control, f"--wds-start-network={network}", *self._same_client(), limit_s=CONNECT_S
        )
        self._keep(session._replace(handle=value(HANDLE, printed, "qmicli")))
        printed = yield from run(*self._control, "--wds-get-current-settings", *self._same_client())
        yield from self._configure(qmi_settings(printed))

    def down(self) -> Script[None]:
        yield from self._end()
        yield from self._clear()

    def leave(self) -> list[tuple[str, ...]]:
        """Return command lines that end the session. Its file stays, because their success is unknown."""
        ending = [self._ending(self._session)] if self._session is not None and self._control else []
        return ending + super().leave()

    def _end(self) -> Script[None]:
        if self._session is not None and self._control:
            yield from _tolerated(run(*self._ending(self._session)))
            self._keep(None)

    def _ending(self, session: Session) -> tuple[str, ...]:
        """Return the command line that stops the packet service and releases the client."""
        stop = f"--wds-stop-network={session.handle}" if session.handle else "--wds-noop"
        return *self._control, stop, f"--client-cid={session.client}"

    def _keep(self, session: Session | None) -> None:
        self._session = session
        self._file.keep(session)

    def look(self) -> Script[tuple[str, ...]]:
        """Return the addresses. Raises LostError if the network has ended the packet service."""
        printed = yield from run(*self._control, "--wds-get-packet-service-status", *self._same_client())
        if "Connection status: 'connected'" not in printed:
            raise LostError("the network has ended the packet service")
        return (yield from super().look())

    def _same_client(self) -> tuple[str, str]:
        client = self._session.client if self._session is not None else ""
        return f"--client-cid={client}", "--client-no-release-cid"


class Mbim(Bearer):
    """Bearer by mbimcli, through mbim-proxy."""

    def __init__(self, options: ModemOptions, system: System) -> None:
        super().__init__(options, system)
        self._control: tuple[str, ...] = ()

    def up(self) -> Script[None]:
        yield from self.find_device()
        self._control = ("mbimcli", f"--device={self._system.control_device(self._options.usb)}", "--device-open-proxy")
        version = "ipv6" if self._options.ip_type == "ipv6" else "ipv4"
        yield from run(*self._control, "--attach-packet-service", limit_s=CONNECT_S)
        connect = f"--connect=apn='{self._options.apn}',ip-type={version}"
        printed = yield from run(*self._control, connect, limit_s=CONNECT_S)
        yield from self._configure(mbim_settings(printed))

    def down(self) -> Script[None]:
        if self._control:
            yield from _tolerated(run(*self._control, "--disconnect"))
        yield from self._clear()

    def leave(self) -> list[tuple[str, ...]]:
        return ([(*self._control, "--disconnect")] if self._control else []) + super().leave()

    def look(self) -> Script[tuple[str, ...]]:
        """Return the addresses. Raises LostError if the network has ended the packet service."""
        printed = yield from run(*self._control, "--query-connection-state")
        if "Activation state: 'activated'" not in printed:
            raise LostError("the network has ended the packet service")
        return (yield from super().look())


class Rndis(Bearer):
    """Bearer by RNDIS: the modem is a router, and udhcpc keeps the network device's address by DHCP while it runs."""

    def up(self) -> Script[None]:
        yield from self.find_device()
        yield from run("ip", "link", "set", "dev", self.device, "up")
        yield from self._lease()

    def down(self) -> Script[None]:
        self._system.stop_kept()
        yield from self._clear()

    def look(self) -> Script[tuple[str, ...]]:
        """Return the addresses. Raises LostError if udhcpc has ended, because the lease is then not renewed."""
        if not self._system.is_keeping:
            raise LostError("udhcpc has ended; the lease is not renewed")
        yield from self._correct_metric()
        return (yield from super().look())

    def _correct_metric(self) -> Script[None]:
        """Restore the metric of the default route, which the machine's own script of udhcpc sets at each lease."""
        wanted = self._options.metric
        routes = self._system.default_routes(self.device)
        for route in routes:
            way = ("default", "via", route.gateway, "dev", self.device, "metric")
            if route.metric != wanted:
                yield from run("ip", "-4", "route", "replace", *way, str(wanted))
                yield from run("ip", "-4", "route", "del", *way, str(route.metric))

    def _lease(self) -> Script[None]:
        self._system.stop_kept()
        # udhcpc stays in the foreground and ends if no server answers. It renews the lease as long as it runs.
        dhcp = ("udhcpc", "-f", "-n", "-t", "10", "-T", "2", "-i", self.device)
        yield from run(*dhcp, limit_s=30.0, keep=LEASE)


class AtCall(Rndis):
    """Bearer by an AT call ($QCRMCALL) on the RMNET device of qmi_wwan, then DHCP."""

    def up(self) -> Script[None]:
        yield from self.find_device()
        yield from run("ip", "link", "set", "dev", self.device, "down")
        # raw_ip: packets have no Ethernet headers, which is the only form that an SDX55 supports.
        yield from run("sh", "-c", 'echo Y > "$0"', str(self._system.raw_ip(self.device)))
        yield from run("ip", "link", "set", "dev", self.device, "up")
        yield from lines("AT$QCRMCALL=1,1")
        yield from self._lease()

    def down(self) -> Script[None]:
        yield from super().down()
        yield from ask("AT$QCRMCALL=0,1")


class Elsewhere(Bearer):
    """Bearer `none`: another program transports the packets; the state of the packet context is the link's state."""

    def up(self) -> Script[None]:
        states = yield from lines("AT+CGACT?")
        if not any(is_active(line, 1) for line in states):
            yield from lines("AT+CGACT=1,1")

    def down(self) -> Script[None]:
        return
        yield  # makes this function a generator, as a script must be

    def look(self) -> Script[tuple[str, ...]]:
        """Return the addresses of the packet context. Raises LostError if the network assigns none."""
        found = addresses((yield from lines("AT+CGPADDR=1")))
        if not found:
            raise LostError("the packet context has no address")
        return tuple(str(one) for one in found)


BEARERS: dict[str, Callable[[ModemOptions, System], Bearer]] = {
    "qmi": Qmi,
    "mbim": Mbim,
    "rndis": Rndis,
    "at": AtCall,
    "none": Elsewhere,
}

# USB composition that a bearer needs: vendor and product ID. A composition is the set of USB interfaces that the modem
# offers. Source: Linux drivers/usb/serial/option.c, net/usb/qmi_wwan.c.
COMPOSITIONS = {"qmi": (0x1E0E, 0x9001), "at": (0x1E0E, 0x9001), "rndis": (0x1E0E, 0x9011), "mbim": (0x1E0E, 0x901E)}

# Number of the USB interface with the AT port, by composition. With RNDIS the serial ports follow its two interfaces.
# For MBIM the number is not public; the default, that of the QMI composition, is assumed.
AT_INTERFACES = {"1e0e:9001": 2, "1e0e:9011": 4}
AT_INTERFACE = 2


def _tolerated(script: Script[str]) -> Script[None]:
    """Run a script whose failure is harmless: the object that it takes down may already be gone."""
    try:
        yield from script
    except StepError:
        return
