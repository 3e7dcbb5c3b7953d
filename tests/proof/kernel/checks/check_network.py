"""Network devices that are USB modules: the radio's NCM, and the modem's RNDIS with an address by DHCP."""

import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from board import usb
from board.machine import REAL
from board.runtime.errors import InterfaceError
from board.runtime.loop import Loop
from drivers.sim.modem.modem import SimulatedModem
from drivers.sim8202g.driver import Sim8202g
from drivers.sim8202g.options import ModemOptions
from tests.drivers.host import SHARED
from tests.drivers.sim8202g.modem import Station
from tests.proof.kernel.checks.gadget import Gadget
from tests.proof.kernel.checks.kernel import Seen, children, load, run, started, until

# What the module at the other end is: a namespace of its own, or the kernel would talk to itself without any USB.
MODULE = "module"
MODULE_ADDRESS, FIRST_LEASE = "192.168.225.1", "192.168.225.20"

AT = 3  # the function that is the AT port: RNDIS has the interfaces 0 and 1, so it is interface 4
BOOT_S = 1.0

# What udhcpc calls with each change: what Debian's package of that name brings, as short as can be.
SCRIPT = """#!/bin/sh
case $1 in
deconfig) ip addr flush dev "$interface" ;;
bound | renew)
    ip addr replace "$ip/$mask" dev "$interface"
    ip route replace default via "$router" dev "$interface" metric 700
    ;;
esac
"""


@pytest.fixture
def module() -> Iterator[str]:
    run("ip", "netns", "add", MODULE)
    run("ip", "-n", MODULE, "link", "set", "lo", "up")
    yield MODULE
    run("ip", "netns", "del", MODULE)


def test_the_network_of_the_radio_is_found_by_its_place_and_answers(module: str, loop: Loop, seen: Seen) -> None:
    load("cdc_ncm")
    with Gadget("0525:a4a1", ["ncm.0"], controller=2, names=("Unex", "SOM-301E")) as gadget:
        with pytest.raises(InterfaceError):
            usb.network_device(REAL, gadget.place)
        gadget.plug()
        until(loop, lambda: _network_device(gadget))
        name = usb.network_device(REAL, gadget.place)
        run("ip", "addr", "add", "192.168.225.2/24", "dev", name)
        run("ip", "link", "set", name, "up")
        _give(gadget.network_device(0), module)  # last: else it was never heard of in two runs of three
        until(loop, lambda: _answers("1") or _tell_again(module, gadget.network_device(0)))
        assert _answers("3")
        seen(f"{name} at {gadget.place}, driver cdc_ncm; 3 of 3 pings answered")
        gadget.unplug()
        until(loop, lambda: usb.find(REAL, gadget.place) is None)
        assert not Path("/sys/class/net", name).exists()
        seen("gone when it is unplugged")


def _tell_again(namespace: str, device: str) -> bool:
    """Returns False.

    The module's end tells the host once that it has come up. Linux 6.1 loses that where the host does not listen yet.
    """
    run("ip", "-n", namespace, "link", "set", device, "down")
    run("ip", "-n", namespace, "link", "set", device, "up")
    return False


def _answers(times: str) -> bool:
    return (
        subprocess.run(["ping", "-c", times, "-W", "5", MODULE_ADDRESS], capture_output=True, check=False).returncode
        == 0
    )


def test_the_bearer_comes_up_by_rndis_and_dhcp(module: str, loop: Loop, seen: Seen, tmp_path: Path) -> None:
    for name in ("option", "rndis_host"):
        load(name)
    script = Path("/etc/udhcpc/default.script")
    script.parent.mkdir(exist_ok=True)
    script.write_text(SCRIPT)
    script.chmod(0o755)
    with Gadget("1e0e:9011", ["rndis.0", *(f"gser.{number}" for number in range(3))]) as gadget:
        modem = SimulatedModem(loop, lambda device: gadget.plug(), gadget.unplug, path=gadget.tty(AT))
        modem.boot_s, modem.product = BOOT_S, "9011"
        modem.supplied(True)
        until(loop, lambda: gadget.is_plugged)
        _give(gadget.network_device(0), module)
        leases = tmp_path / "udhcpd.conf"
        leases.write_text(
            f"start {FIRST_LEASE}\nend {FIRST_LEASE}\ninterface {gadget.network_device(0)}\nmax_leases 1\n"
            f"lease_file {tmp_path}/leases\noption subnet 255.255.255.0\noption router {MODULE_ADDRESS}\n"
        )
        (tmp_path / "leases").touch()
        with started("ip", "netns", "exec", module, "udhcpd", "-f", str(leases)):
            others = children()
            options = ModemOptions(usb=gadget.place, bearer="rndis", state_dir=str(tmp_path))
            driver = Sim8202g(options, SHARED)
            station = Station(loop, driver)
            station.begin()
            took = until(loop, lambda: station.is_up, 120.0)
            seen(f"up after {took:.0f} s: {station.why}")
            assert FIRST_LEASE in station.why
            assert f"default via {MODULE_ADDRESS}" in run("ip", "route")
            driver.stop()
            begun = len(children() - others)
            until(loop, lambda: children() <= others)  # else they are told of a later check
            seen(f"{begun} of its programs end with it")
            modem.close()


def _give(device: str, namespace: str) -> None:
    """The module's end of a network."""
    run("ip", "link", "set", device, "netns", namespace)
    run("ip", "-n", namespace, "addr", "add", f"{MODULE_ADDRESS}/24", "dev", device)
    run("ip", "-n", namespace, "link", "set", device, "up")


def _network_device(gadget: Gadget) -> str:
    try:
        return usb.network_device(REAL, gadget.place)
    except InterfaceError:
        return ""
