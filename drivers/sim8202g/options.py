"""Options of an interface with a cellular modem."""

import re
from dataclasses import dataclass
from typing import Annotated, Literal

from board import topology
from board.runtime.address import check_device_name
from board.runtime.describe import Range, at_key
from board.runtime.errors import ConfigurationError

# Parameter <mode> of AT+CNMP by network mode (SIMCom AT command manual of the SIM82xx V1.02).
NETWORK_MODES = {"auto": 2, "gsm": 13, "wcdma": 14, "lte": 38, "nr5g": 71, "lte-nr5g": 109, "wcdma-lte-nr5g": 55}

IP_TYPES = {"ipv4": "IP", "ipv6": "IPV6", "ipv4v6": "IPV4V6"}

# An access point name consists of DNS labels (TS 23.003 clause 9.1). It must not contain quotes, because the driver
# quotes it in AT commands and command lines.
_APN = re.compile(r"[A-Za-z0-9._-]{0,100}")


@dataclass(frozen=True)
class ModemOptions:
    """SIMCom SIM8202G-M2: a bearer, which carries no messages itself.

    usb           topology path of the module, as `usb` of a slot; the driver finds its ports by interface number.
    port          path of its AT port, in place of usb.
    pin_file      file with the PIN of the SIM, mode 0600. Empty: a SIM that asks for a PIN is a fault.
    state_dir     folder for refused PINs, and for the network that qmicli has started.
    apn           access point name. Empty: that of the network.
    ip_type       type of the packet context. For ipv4v6 the bearers qmi and mbim use IPv4.
    network_mode  radio access technologies that the modem may use. `keep`: as set in the module.
    bearer        path of packets to this machine. `qmi`, `mbim`: by qmicli and mbimcli of libqmi and libmbim;
                  `rndis`: the modem is a router with DHCP; `at`: a call by $QCRMCALL, then DHCP; `none`: another
                  program does it, the link is up while the network gives an address.
    device        network device. Empty: that of the module at usb.
    metric        metric of the default route, with every bearer but none.
    poll_s        interval of signal, cell and bearer queries.

    Raises ConfigurationError if not exactly one of usb and port is given, if the bearer does not work with port, or if
    device is invalid. Also if apn has other characters than letters, digits, dots, dashes and underscores.
    """

    usb: str = ""
    port: str = ""
    pin_file: str = ""
    state_dir: str = "/var/lib/captain"
    apn: str = ""
    ip_type: Literal["ipv4", "ipv6", "ipv4v6"] = "ipv4v6"
    network_mode: Literal["keep", "auto", "gsm", "wcdma", "lte", "nr5g", "lte-nr5g", "wcdma-lte-nr5g"] = "auto"
    bearer: Literal["qmi", "rndis", "mbim", "at", "none"] = "qmi"
    device: str = ""
    metric: Annotated[int, Range(0, 4_000_000_000)] = 700
    poll_s: Annotated[float, Range(2.0, 600.0)] = 10.0

    def __post_init__(self) -> None:
        if bool(self.usb) is bool(self.port):
            raise ConfigurationError("a modem is found by one of usb and port", "give exactly one of them")
        if self.usb:
            topology.parse(self.usb)
        elif self.bearer in ("qmi", "mbim"):
            raise ConfigurationError(f"bearer {self.bearer} needs a control port, found by usb", "give usb, not port")
        elif self.bearer in ("rndis", "at") and not self.device:
            raise ConfigurationError(
                f"bearer {self.bearer} with port needs device", "name the network device, or give usb"
            )
        if self.device:
            at_key("device", check_device_name, self.device)
        if not _APN.fullmatch(self.apn):
            raise ConfigurationError(
                f"invalid access point name: {self.apn[:40]!r}", "use letters, digits, dots and dashes"
            )
