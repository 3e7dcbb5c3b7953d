"""Every kind of interface, by the name that captain.toml calls it: a new one is one line here."""

from drivers.contract import DriverClass
from drivers.ethernet import Ethernet
from drivers.morse import Morse
from drivers.uart import Uart
from drivers.udp import Udp

DRIVERS: dict[str, DriverClass] = {
    "udp": Udp,
    "ethernet": Ethernet,
    "uart": Uart,
    "morse": Morse,
}
