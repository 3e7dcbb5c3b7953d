"""Registry of benches: for each driver, the interface under test and its other end."""

from collections.abc import Callable
from pathlib import Path

from tests.drivers.bench import Bench, ModuleBench
from tests.drivers.module_benches import ModemBench, ReceiverBench, Som301eBench
from tests.drivers.mqtt_bench import MqttBench
from tests.drivers.network_benches import BtpBench, EthernetBench, ListeningBench, PduBench, UdpBench
from tests.drivers.serial_benches import MorseBench, UartBench
from tests.virtual import VirtualLoop

MODULES: dict[str, Callable[[VirtualLoop, Path], ModuleBench]] = {
    "zed_f9p": ReceiverBench,
    "sim8202g": ModemBench,
}
# Benches by the driver's name. If a driver has several, `-` and a word follow; names of drivers contain no hyphen.
BENCHES: dict[str, Callable[[VirtualLoop, Path], Bench | ModuleBench]] = {
    "udp-pdu": PduBench,
    "udp-btp": BtpBench,
    "udp-ethernet": UdpBench,
    "udp-listen": ListeningBench,
    "ethernet": EthernetBench,
    "uart": UartBench,
    "morse": MorseBench,
    "som301e": Som301eBench,
    "mqtt": MqttBench,
    **MODULES,
}
