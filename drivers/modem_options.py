"""What captain.toml says of a cellular modem."""

import re
from dataclasses import dataclass
from typing import Annotated, Literal

from board import topology
from board.address import check_device_name
from board.describe import Range, at_key
from board.errors import ConfigurationError

# <mode> of AT+CNMP (SIMCom AT command manual of the SIM82xx V1.02).
NETWORK_MODES = {"auto": 2, "gsm": 13, "wcdma": 14, "lte": 38, "nr5g": 71, "lte-nr5g": 109, "wcdma-lte-nr5g": 55}

IP_TYPES = {"ipv4": "IP", "ipv6": "IPV6", "ipv4v6": "IPV4V6"}

# Labels of a DNS name (TS 23.003 clause 9.1). It stands inside quotes of AT commands and of command lines.
_APN = re.compile(r"[A-Za-z0-9._-]{0,100}")


@dataclass(frozen=True)
class ModemOptions:
    """Options of an interface with driver = "sim8202g".

    usb       topology path of the module, as its slot has it; its ports are found by interface number.
    port      path of its AT port, in place of usb.
    pin_file  file with the PIN of the SIM, mode 0600; empty: a SIM that asks for one is a fault.
    state_dir folder where refused PINs are remembered, and the network that qmicli has begun.
    apn       access point name; empty: the network's own.
    ip_type   of the packet context; of ipv4v6 the bearers qmi and mbim use version 4.
    network_mode  radio accesses that it may use; keep: those that it has been set to.
    bearer    how packets come to this machine. qmi, mbim: by qmicli and mbimcli, which libqmi and libmbim bring;
              rndis: the modem is a router, its address comes by DHCP; at: a call by $QCRMCALL, then DHCP; none:
              somebody else's work: the link is up while the network gives an address.
    device    network device; empty: the one that the module at usb is.
    metric    of the default route, with every bearer but none.
    poll_s    between two looks at signal, cell and bearer.
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
            raise ConfigurationError(f"{self.apn[:40]!r} is no access point name", "letters, digits, dots and dashes")
