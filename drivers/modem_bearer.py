"""Bearers: how packets get from the modem to a network device of this machine, one script each way.

qmi and mbim have been tested as command lines and by what the tools print, not with a module: their tools need one.
Sources: man qmicli(1), mbimcli(1), udhcpc of busybox; AT command manual of the SIM82xx V1.02 ($QCRMCALL).
"""

import re
from collections.abc import Callable
from ipaddress import IPv4Network
from typing import NamedTuple

from board.errors import InterfaceError
from drivers.modem_options import ModemOptions
from drivers.modem_script import LostError, Pause, Script, StepError, ask, lines, run
from drivers.modem_system import System
from drivers.wire.modem_answers import addresses, flag

DEVICE_TRIES = 15  # one a second

CONNECT_S = 60.0  # that a network takes to set up a packet context; most need 1 s

# busybox before 1.34 writes a capital letter.
LEASE = r"[Ll]ease of [0-9.]+ obtained"

# What qmicli and mbimcli print.
_HANDLE = re.compile(r"Packet data handle: '?(\d+)")
_CLIENT = re.compile(r"CID: '?(\d+)")
_QMI_ADDRESS = re.compile(r"IPv4 address: ([0-9.]+)")
_QMI_MASK = re.compile(r"IPv4 subnet mask: ([0-9.]+)")
_QMI_GATEWAY = re.compile(r"IPv4 gateway address: ([0-9.]+)")
_MTU = re.compile(r"MTU: '?(\d+)")
_QMI_ADDRESS6 = re.compile(r"IPv6 address: ([0-9A-Fa-f:]+/\d+)")
_MBIM_ADDRESS = re.compile(r"IP \[0\]: '([0-9A-Fa-f.:]+/\d+)'")
_MBIM_GATEWAY = re.compile(r"Gateway: '([0-9A-Fa-f.:]+)'")


class Settings(NamedTuple):
    """What the network gave. address with its prefix length: `10.64.1.2/30`."""

    address: str
    gateway: str
    mtu: int


class Bearer:
    """One way; the scripts of a bearer that keeps nothing.

    device  of the network, once it is known; empty for none.
    """

    def __init__(self, options: ModemOptions, system: System) -> None:
        self._options = options
        self._system = system
        self.device = ""

    def up(self) -> Script[None]:
        """Bring it up. Raises StationError."""
        raise NotImplementedError

    def down(self) -> Script[None]:
        """Take it down, whatever state it is in."""
        raise NotImplementedError

    def look(self) -> Script[tuple[str, ...]]:
        """Its addresses. Raises LostError where there is none."""
        found = self._system.addresses(self.device)
        if not found:
            raise LostError(f"{self.device} has no address any more")
        return found
        yield  # a script that asks for nothing

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
        self._client = self._handle = ""

    def up(self) -> Script[None]:
        yield from self.find_device()
        self._control = ("qmicli", f"--device={self._system.control_device(self._options.usb)}", "--device-open-proxy")
        yield from run("ip", "link", "set", "dev", self.device, "down")
        yield from run(*self._control, "--set-expected-data-format=raw-ip")
        yield from run("ip", "link", "set", "dev", self.device, "up")
        version = "6" if self._options.ip_type == "ipv6" else "4"
        network = f"apn='{self._options.apn}',ip-type={version}" if self._options.apn else f"ip-type={version}"
        started = yield from run(
            *self._control, f"--wds-start-network={network}", "--client-no-release-cid", limit_s=CONNECT_S
        )
        self._client, self._handle = _found(_CLIENT, started, "qmicli"), _found(_HANDLE, started, "qmicli")
        printed = yield from run(*self._control, "--wds-get-current-settings", *self._same_client())
        yield from self._configure(qmi_settings(printed))

    def down(self) -> Script[None]:
        if self._handle:
            stop = f"--wds-stop-network={self._handle}"
            yield from _tolerated(run(*self._control, stop, f"--client-cid={self._client}"))
            self._client = self._handle = ""
        yield from self._clear()

    def look(self) -> Script[tuple[str, ...]]:
        printed = yield from run(*self._control, "--wds-get-packet-service-status", *self._same_client())
        if "Connection status: 'connected'" not in printed:
            raise LostError("the network has ended the packet service")
        return (yield from super().look())

    def _same_client(self) -> tuple[str, str]:
        return f"--client-cid={self._client}", "--client-no-release-cid"


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
        return (yield from super().look())

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
        self._system.set_raw_ip(self.device)
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
        if not any(line.startswith("+CGACT: 1,") and flag(line, "+CGACT") for line in states):
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


def qmi_settings(printed: str) -> Settings:
    """What `qmicli --wds-get-current-settings` prints. Raises StepError without an address."""
    mtu = _MTU.search(printed)
    size = int(mtu[1]) if mtu else 1500
    if (address6 := _QMI_ADDRESS6.search(printed)) and not _QMI_ADDRESS.search(printed):
        return Settings(address6[1], "", size)
    address, mask = _found(_QMI_ADDRESS, printed, "qmicli"), _found(_QMI_MASK, printed, "qmicli")
    gateway = _QMI_GATEWAY.search(printed)
    try:
        prefix = IPv4Network(f"0.0.0.0/{mask}").prefixlen
    except ValueError as error:
        raise StepError(f"qmicli: {mask} is no mask") from error
    return Settings(f"{address}/{prefix}", gateway[1] if gateway else "", size)


def mbim_settings(printed: str) -> Settings:
    """What `mbimcli --connect` prints. Raises StepError without an address."""
    mtu, gateway = _MTU.search(printed), _MBIM_GATEWAY.search(printed)
    address = _found(_MBIM_ADDRESS, printed, "mbimcli")
    return Settings(address, gateway[1] if gateway else "", int(mtu[1]) if mtu else 1500)


def _found(pattern: re.Pattern[str], text: str, tool: str) -> str:
    match = pattern.search(text)
    if match is None:
        raise StepError(f"{tool} did not print {pattern.pattern.partition(':')[0]}", "is it another version?")
    return match[1]


def _tolerated(script: Script[str]) -> Script[None]:
    """Run what may fail without harm: what it takes down may be gone already."""
    try:
        yield from script
    except StepError:
        return
