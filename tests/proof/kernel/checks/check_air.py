"""The `ethernet` driver on 802.11p: two simulated radios of the kernel in OCB mode, set by the commands of its guide."""

import json
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest

from board.runtime.loop import Loop
from drivers.ethernet import Ethernet, EthernetOptions
from firmware.lab import netns
from tests.drivers.host import CAM, SHARED, Host, request
from tests.proof.kernel.checks.kernel import Seen, load, run

ROOT = Path(__file__).resolve().parents[4]
# The guide's commands, which a user runs as root: OCB mode, channel, and what iw then shows of the device.
(COMMANDS,) = re.findall(
    r"^```sh ocb\n(.*?)^```", (ROOT / "drivers/guide/ocb.md").read_text(), re.MULTILINE | re.DOTALL
)
DEVICE = "wlan0"  # in the guide
NAMESPACES = ("a", "b")
# regtest=5 of mac80211_hwsim gives both radios a world in which 5.9 GHz may be used; the others leave it disabled.
REGTEST = 5

# The queues of an 802.11 device, in their order (ieee80211_ac_numbers of mac80211).
QUEUES = ("AC_VO", "AC_VI", "AC_BE", "AC_BK")

# Socket priority by traffic class: 256 and the user priority of its access category.
PRIORITIES = {0: 263, 1: 261, 2: 256, 3: 257}


@pytest.fixture(scope="module")
def devices() -> Iterator[tuple[str, str]]:
    """Two radios in OCB mode, each in a namespace, as `captain lab --devices` takes them."""
    load("mac80211_hwsim", radios=2, regtest=REGTEST)
    names = []
    for namespace, phy in zip(NAMESPACES, sorted(Path("/sys/class/ieee80211").iterdir()), strict=True):
        (device,) = (path.name for path in (phy / "device/net").iterdir())
        names.append(f"{namespace}:{device}")
        run("ip", "netns", "add", namespace)
        run("iw", "phy", phy.name, "set", "netns", "name", namespace)
        run("ip", "-n", namespace, "link", "set", "lo", "up")
        run("ip", "netns", "exec", namespace, "sh", "-euc", COMMANDS.replace(DEVICE, device))
    yield names[0], names[1]
    for namespace in NAMESPACES:
        run("ip", "netns", "del", namespace)
    run("modprobe", "-r", "mac80211_hwsim")


def test_radios_by_the_commands_of_the_guide_are_in_ocb_mode_10_mhz_wide(devices: tuple[str, str], seen: Seen) -> None:
    for one in devices:
        namespace, device = one.split(":")
        told = run("ip", "netns", "exec", namespace, "iw", "dev", device, "info")
        (kind, channel) = (line.strip() for line in told.splitlines() if "type " in line or "channel" in line)
        assert "outside context of a BSS" in kind
        assert "5900 MHz" in channel
        assert "width: 10 MHz" in channel
        seen(f"{device}: {channel}")


def test_the_ten_message_lab_test_loses_nothing(
    devices: tuple[str, str], seen: Seen, pytestconfig: pytest.Config
) -> None:
    duration = str(pytestconfig.getoption("--lab-s"))
    told = json.loads(run(".venv/bin/captain", "lab", "--devices", *devices, "--duration", duration, "--json"))
    sent, equal = (sum(row[key] for row in told["messages"]) for key in ("sent", "equal"))
    seen(f"{sent} sent in {duration} s, {equal} received and equal, {told['lost']} lost, {told['altered']} altered")
    assert (told["lost"], told["altered"]) == (0, 0)
    assert equal == sent > 0


def test_a_frame_has_the_priority_of_its_traffic_class(devices: tuple[str, str], seen: Seen) -> None:
    """As what leaves the socket shows; the queue that mac80211 makes of it is only told."""
    namespace, device = devices[0].split(":")
    tc = ("tc", "-n", namespace)
    run(*tc, "qdisc", "add", "dev", device, "clsact")
    for priority in PRIORITIES.values():
        match = ("protocol", "all", "basic", "match", f"meta(priority eq {priority})", "action", "ok")
        run(*tc, "filter", "add", "dev", device, "egress", "pref", str(priority), *match)
    before = _sent_by_queue(devices[0])
    with netns.named(namespace).inside():
        _send(device, PRIORITIES)
    for number, priority in PRIORITIES.items():
        told = run(*tc, "-s", "filter", "show", "dev", device, "egress", "pref", str(priority))
        assert " 1 pkt " in told, f"traffic class {number}, priority {priority}: {told}"
    left = _sent_by_queue(devices[0]) - before
    seen(", ".join(f"class {number}: {priority}" for number, priority in PRIORITIES.items()))
    # Linux 6.1 has no QoS header for what goes to all, and best effort for what has none (mac80211/wme.c).
    seen(f"mac80211 sends {', '.join(f'{count} by {queue}' for queue, count in left.items())}")


def _send(device: str, classes: Iterable[int]) -> None:
    """A frame of each traffic class, by the driver."""
    loop = Loop()
    driver = Ethernet(EthernetOptions(device, beacon_s=0.0), SHARED)
    driver.start(Host(loop))
    for number in classes:
        driver.send(request(CAM)._replace(traffic_class=number))
    driver.stop()
    loop.close()


def _sent_by_queue(device: str) -> Counter[str]:
    """Frames that have left by each queue of a device."""
    namespace, name = device.split(":")
    told = json.loads(run("tc", "-n", namespace, "-s", "-j", "qdisc", "show", "dev", name))
    queues = {one["parent"]: one["packets"] for one in told if "parent" in one}
    return Counter({name: queues[f":{number}"] for number, name in enumerate(QUEUES, 1)})
