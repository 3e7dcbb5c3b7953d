"""Bearers: how packets get from the modem to a network device of this machine, one script each way.

qmi and mbim have been tested as command lines and by what the tools print, not with a module: their tools need one.
Sources: man qmicli(1), mbimcli(1), udhcpc of busybox; AT command manual of the SIM82xx V1.02 ($QCRMCALL).
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from pathlib import Path

from board.errors import InterfaceError
from drivers.modem_options import ModemOptions
from drivers.modem_printed import ADDRESS, CLIENT, HANDLE, LEASE, Settings, mbim_settings, qmi_settings, value
from drivers.modem_script import LostError, Pause, Script, StepError, ask, lines, run
from drivers.modem_session import Session, SessionFile
from drivers.modem_system import System
from drivers.wire.modem_answers import addresses, is_active

DEVICE_TRIES = 15  # one a second

CONNECT_S = 60.0  # that a network takes to set up a packet context; most need 1 s


class Bearer(ABC):
    """One way; the scripts of a bearer that keeps nothing.

    device  of the network, once it is known; empty for none.
    """

    def __init__(self, options: ModemOptions, system: System) -> None:
        self._options = options
        self._system = system
        self.device = ""

    @abstractmethod
    def up(self) -> Script[None]:
        """Bring it up. Raises StationError."""

    @abstractmethod
    def down(self) -> Script[None]:
        """Take it down, whatever state it is in."""

    def look(self) -> Script[tuple[str, ...]]:
        """Its addresses. Raises LostError where there is none.

        Asked of a program: the kernel answers such a question under its lock of all network devices, which whoever
        takes one down may hold for seconds.
        """
        found = ADDRESS.findall((yield from run("ip", "-o", "addr", "show", "dev", self.device, "scope", "global")))
        if not found:
            raise LostError(f"{self.device} has no address any more")
        return tuple(found)

    def leave(self) -> list[tuple[str, ...]]:
        """Programs that end what they can of it, when there is no time to wait for them."""
        return [("ip", "addr", "flush", "dev", self.device)] if self.device else []

    def find_device(self) -> Script[None]:
        """Wait for the network device: its driver starts after that of the ports. Raises InterfaceError."""
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
        """Give the device what the network gave."""
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
    """By qmicli, through qmi-proxy, so that the client that holds the connection lives on between calls."""

    def __init__(self, options: ModemOptions, system: System) -> None:
        super().__init__(options, system)
        self._control: tuple[str, ...] = ()
        self._file = SessionFile(Path(options.state_dir) / f"{options.usb}-qmi.json")
        self._session = self._file.load()  # of a station that ended without a word

    def up(self) -> Script[None]:
        yield from self.find_device()
        self._control = ("qmicli", f"--device={self._system.control_device(self._options.usb)}", "--device-open-proxy")
        yield from self._end()
        yield from run("ip", "link", "set", "dev", self.device, "down")
        yield from run(*self._control, "--set-expected-data-format=raw-ip")
        yield from run("ip", "link", "set", "dev", self.device, "up")
        # First a client, then its network: of a client that comes with a network that fails nobody hears.
        printed = yield from run(*self._control, "--wds-noop", "--client-no-release-cid")
        self._keep(Session(value(CLIENT, printed, "qmicli")))
        version = "6" if self._options.ip_type == "ipv6" else "4"
        network = f"apn='{self._options.apn}',ip-type={version}" if self._options.apn else f"ip-type={version}"
        printed = yield from run(
            *self._control, f"--wds-start-network={network}", *self._same_client(), limit_s=CONNECT_S
        )
        assert self._session is not None
        self._keep(self._session._replace(handle=value(HANDLE, printed, "qmicli")))
        printed = yield from run(*self._control, "--wds-get-current-settings", *self._same_client())
        yield from self._configure(qmi_settings(printed))

    def down(self) -> Script[None]:
        yield from self._end()
        yield from self._clear()

    def leave(self) -> list[tuple[str, ...]]:
        """The file stays: whether these programs were able to do it is not waited for."""
        ending = [self._ending(self._session)] if self._session is not None and self._control else []
        return ending + super().leave()

    def _end(self) -> Script[None]:
        if self._session is not None and self._control:
            yield from _tolerated(run(*self._ending(self._session)))
            self._keep(None)

    def _ending(self, session: Session) -> tuple[str, ...]:
        """What stops the packets and releases the client."""
        stop = f"--wds-stop-network={session.handle}" if session.handle else "--wds-noop"
        return *self._control, stop, f"--client-cid={session.client}"

    def _keep(self, session: Session | None) -> None:
        self._session = session
        self._file.keep(session)

    def look(self) -> Script[tuple[str, ...]]:
        printed = yield from run(*self._control, "--wds-get-packet-service-status", *self._same_client())
        if "Connection status: 'connected'" not in printed:
            raise LostError("the network has ended the packet service")
        return (yield from super().look())

    def _same_client(self) -> tuple[str, str]:
        client = self._session.client if self._session is not None else ""
        return f"--client-cid={client}", "--client-no-release-cid"


class Mbim(Bearer):
    """By mbimcli, through mbim-proxy."""

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
        printed = yield from run(*self._control, "--query-connection-state")
        if "Activation state: 'activated'" not in printed:
            raise LostError("the network has ended the packet service")
        return (yield from super().look())


class Rndis(Bearer):
    """The modem is a router: its device has an address by DHCP as long as udhcpc runs."""

    def up(self) -> Script[None]:
        yield from self.find_device()
        yield from run("ip", "link", "set", "dev", self.device, "up")
        yield from self._lease()

    def down(self) -> Script[None]:
        self._system.stop_kept()
        yield from self._clear()

    def look(self) -> Script[tuple[str, ...]]:
        if not self._system.is_keeping:
            raise LostError("udhcpc has ended: nobody renews the lease")
        yield from self._correct_metric()
        return (yield from super().look())

    def _correct_metric(self) -> Script[None]:
        """The script of udhcpc, which is the machine's own, sets the route with each lease as it likes."""
        wanted = self._options.metric
        routes = self._system.default_routes(self.device)
        for route in routes:
            way = ("default", "via", route.gateway, "dev", self.device, "metric")
            if route.metric != wanted:
                yield from run("ip", "-4", "route", "replace", *way, str(wanted))
                yield from run("ip", "-4", "route", "del", *way, str(route.metric))

    def _lease(self) -> Script[None]:
        self._system.stop_kept()
        # In the foreground, one that gives up where nobody answers; it renews its lease for as long as it runs.
        dhcp = ("udhcpc", "-f", "-n", "-t", "10", "-T", "2", "-i", self.device)
        yield from run(*dhcp, limit_s=30.0, keep=LEASE)


class AtCall(Rndis):
    """A call by AT on the RMNET device of qmi_wwan, then DHCP."""

    def up(self) -> Script[None]:
        yield from self.find_device()
        yield from run("ip", "link", "set", "dev", self.device, "down")
        # Packets without Ethernet headers, which is all that an SDX55 speaks.
        yield from run("sh", "-c", 'echo Y > "$0"', str(self._system.raw_ip(self.device)))
        yield from run("ip", "link", "set", "dev", self.device, "up")
        yield from lines("AT$QCRMCALL=1,1")
        yield from self._lease()

    def down(self) -> Script[None]:
        yield from super().down()
        yield from ask("AT$QCRMCALL=0,1")


class Elsewhere(Bearer):
    """Somebody else moves the packets; whether there are any to move says the packet context."""

    def up(self) -> Script[None]:
        states = yield from lines("AT+CGACT?")
        if not any(is_active(line, 1) for line in states):
            yield from lines("AT+CGACT=1,1")

    def down(self) -> Script[None]:
        return
        yield  # a script that asks for nothing

    def look(self) -> Script[tuple[str, ...]]:
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

# The composition that a bearer needs, by vendor and product (Linux drivers/usb/serial/option.c, net/usb/qmi_wwan.c).
COMPOSITIONS = {"qmi": (0x1E0E, 0x9001), "at": (0x1E0E, 0x9001), "rndis": (0x1E0E, 0x9011), "mbim": (0x1E0E, 0x901E)}

# Number of the USB interface that is the AT port. RNDIS stands in front of the serial ports and has two. Where the port
# of MBIM's composition is, is not public: as in the first one.
AT_INTERFACES = {"1e0e:9001": 2, "1e0e:9011": 4}
AT_INTERFACE = 2


def _tolerated(script: Script[str]) -> Script[None]:
    """Run what may fail without harm: what it takes down may be gone already."""
    try:
        yield from script
    except StepError:
        return
