"""Box with modules: `captain selftest` on the card, with simulated modules.

Kernel modules that Debian leaves out are copied in once it runs, and simulate lines and chips. Pulses are timed here.
The simulators of drivers/sim speak at serial ports of the guest's USB, at the places of the board's slots. Each is
plugged in while it has power.
"""

import json
import shlex
import shutil
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import zmq

from board.time.scales import EPOCH, GPS_LEAD, leap_seconds
from drivers.sim.modem.modem import SimulatedModem
from drivers.sim.receiver.habits import Habits
from drivers.sim.receiver.receiver import Receiver
from drivers.sim.usb_tree import SimulatedDevice
from image.description import read
from image.errors import ImageError
from tests.proof.clock.bench import Bench, Pulser, bench
from tests.proof.clock.card import INSIDE, Card, prepare
from tests.proof.clock.machine import MADE, PROJECT, Guest, LateError
from tests.proof.clock.stated import asked
from tests.proof.clock.truth import Truth
from tests.proof.image.machine import NotSeenError, held_ports, user_network
from tests.proof.image.modules import built
from tests.proof.image.rows import Options, Row
from tests.proof.image.usb import Usb

HERE = Path(__file__).parent
BOARD = HERE / "emulated.toml"
PLACES = {"gnss": "1-1.1.1", "cellular": "1-1.1.4"}
POWER_LINE = 4
TOLD = ("settling", "locked", "holdover")  # of the time, by pulses
SELFTEST = ("captain", "selftest", "--json")
TRIES = 3
PAUSE = 5  # statuses, one a second, before the next try
UP_S = 600.0  # emulated, on a busy machine
# A station starts in 2 s on a Pi, and took 45 to 90 s here beside other units. systemd kills it after 90 s, and again.
PATIENT = r"printf '[Service]\nTimeoutStartSec=300\n' | systemctl edit --runtime --stdin captain.service"
HAT = {
    "vendor": "captain",
    "product": "Quad Expander, emulated",
    "product_id": "0x0001",
    "product_ver": "0x0001",
    "uuid": "d9f3a1c4-5e60-4b7a-9c2d-0123456789ab",
}
DEVICES = {
    "/dev/gpiochip*": "gpio 660",
    "/dev/pps0": "pps 640",
    "/dev/i2c-*": "i2c 660",
    "/dev/ttyUSB*": "dialout 660",
    "/dev/slot/gnss-00": "dialout 660",
    "/dev/slot/cellular-00": "dialout 660",
}
CAPTAIN = """\
[station]
name = "emulated"
[endpoint]
address = "0.0.0.0"
[time]
chrony = "/run/chrony.captain.sock"
tracking = true
"""


def rows(card: Path, folder: Path, options: Options) -> Iterator[Row]:
    prepare()
    now = int(time.time())
    truth = Truth(now - EPOCH + leap_seconds(now))
    try:
        with bench(truth) as on:
            box = Box(on, card, folder)
            try:
                yield from box.rows()
            except LateError as error:
                raise NotSeenError(f"{error}; {box.last_status}") from error
            finally:
                box.close()
    except (LateError, ImageError) as error:
        raise NotSeenError(str(error)) from error


class Box:
    """A card in a guest, its modules at this machine."""

    def __init__(self, on: Bench, card: Path, folder: Path) -> None:
        self._on = on
        self._usb = Usb(folder)
        self._plugged: list[str] = []
        on.truth.start()
        its_s = on.truth.its_s
        habits = Habits(gps_s=its_s + GPS_LEAD)
        self._receiver = Receiver(
            on.loop, habits, appeared=lambda path: self._plug("gnss", path), vanished=lambda: self._unplug("gnss")
        )
        self._modem = SimulatedModem(on.loop, self._plug_modem, lambda: self._unplug("cellular"))
        self._holding = ExitStack()
        self._ports = self._holding.enter_context(held_ports())
        made = Card(card, _device_tree(folder), {"captain.toml": CAPTAIN, "board.toml": BOARD.read_text()})
        words = ["-netdev", user_network(self._ports), "-device", "virtio-net-pci,netdev=eth0,romfile="]
        date = time.strftime("%Y-%m-%dT%H:%M:%S", time.gmtime(time.time() - 86_400))  # a day late, until pulses come
        self.guest = Guest(on.loop, made, "board", folder, date, [*words, *self._usb.words])
        on.boot(self.guest)
        self.guest.hurry()
        self._made = made
        self._statuses: list[dict[str, Any]] = []
        self._context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        self._reports = self._context.socket(zmq.SUB)

    def close(self) -> None:
        self._context.destroy(linger=0)
        self._receiver.unplug()
        self._modem.close()
        self._usb.close()
        self._holding.close()

    def rows(self) -> Iterator[Row]:
        self._on.wait_for_guests()
        yield from self._arranged()
        self._watch()
        began_s = self._on.loop.clock()
        self._until(self._is_up, "everything of the board file")
        took_s = self._on.loop.clock() - began_s
        yield Row("receiver, modem, pulses: up after the station's start", f"{took_s:.0f} s", "", True)
        yield from self._selftest()
        yield from self._names()
        for slot, how in (("gnss", "its line of gpio-sim"), ("cellular", "the kernel's authorized")):
            yield self._cycled(slot, how)

    # Its hardware

    def _arranged(self) -> Iterator[Row]:
        """Modules and chips, then the station anew: what is soldered is there before it on a real board."""
        version = asked(self._on, self.guest, "uname", "-r").strip()
        self._made.hold(self.guest)
        asked(self._on, self.guest, "sh", "-c", PATIENT)
        files = built(read(PROJECT / "image/image.toml").base, version)
        given = [f"{INSIDE}/{path.relative_to(PROJECT)}" for path in files.values()]
        script = f"{INSIDE}/tests/proof/image/guest"
        said = asked(self._on, self.guest, "env", f"LINES={POWER_LINE}", "sh", f"{script}/arrange", *given)
        path = said.strip().splitlines()[-1]
        yield Row(f"modules copied in, of {version}", ", ".join(files), "loaded", path.startswith("/sys/"))
        self.guest.told["levels"] = lambda line: self._receiver.power(line.strip() == "1")
        self.guest.start("levels", "sh", f"{script}/levels", path)
        self._modem.supplied(True)
        self._on.pulser = Pulser(self._on.loop, self._on.truth, [self.guest.monitor], lambda struck: None)
        self._on.pulser.is_on = False
        self._follow_receiver()
        self._made.start(self.guest, "board", "")

    def _follow_receiver(self) -> None:
        """It gives pulses while it knows the time."""
        assert self._on.pulser is not None
        self._on.pulser.is_on = self._receiver.gives_pulses
        self._on.loop.after(0.1, self._follow_receiver)

    def _plug_modem(self, device: SimulatedDevice) -> None:
        self._plug("cellular", next(one.target for one in device.interfaces if one.driver == "option"))

    def _plug(self, name: str, path: str) -> None:
        self._usb.plug(name, PLACES[name], path)

    def _unplug(self, name: str) -> None:
        self._usb.unplug(name)

    # What it says

    def _watch(self) -> None:
        self._reports.setsockopt(zmq.HANDSHAKE_IVL, 5000)  # QEMU takes the connection before the station does
        self._reports.subscribe(b"status.")
        self._reports.connect(f"tcp://127.0.0.1:{self._ports.report}")
        self._look()

    def _look(self) -> None:
        self._on.loop.after(0.1, self._look)
        while self._reports.poll(0):
            self._statuses.append(json.loads(self._reports.recv_multipart()[-1]))

    def _until(self, is_so: Callable[[], object], what: str) -> None:
        self._on.until(is_so, UP_S, what)

    @property
    def last_status(self) -> str:
        """Of interfaces and clock, as the station reported it last."""
        if not self._statuses:
            return "the station has reported no status"
        status = self._statuses[-1]
        links = [f"{name} {one['state']}: {one['why']}" for name, one in status["interfaces"].items()]
        return f"the last status: {'; '.join(links)}; clock {json.dumps(status['clock'])}"

    def _is_up(self) -> bool:
        status = self._statuses[-1] if self._statuses else {}
        states = [one["state"] for one in status.get("interfaces", {}).values()]
        return states == ["up"] * len(PLACES) and status["clock"]["state"] in TOLD

    def _selftest(self) -> Iterator[Row]:
        """As operator, whom no group lets switch anything that the station does not.

        Asked again where something does not work: a busy machine may strike a pulse seconds late, and answer the
        emulated modem late.
        """
        count, (status, said) = 1, self._ran(*SELFTEST)
        while status != 0 and count < TRIES:
            self._statuses.clear()
            self._until(lambda: len(self._statuses) >= PAUSE and self._is_up(), "everything of the board file again")
            count, (status, said) = count + 1, self._ran(*SELFTEST)
        found = json.loads(said) if said.startswith("[") else []
        for one in found:
            if one["works"] is not None:
                yield Row(f"selftest: {one['capability']}", one["value"], "works", one["works"] is True)
        judged = [one for one in found if one["works"] is not None]
        works = sum(one["works"] is True for one in judged)
        seen = f"{works} of {len(judged)} work, exit code {status}, asked {count} x" if judged else said[-60:]
        yield Row("captain selftest", seen, f"all, exit code 0, {TRIES} x at most", status == 0 and bool(judged))

    def _names(self) -> Iterator[Row]:
        """What the rules for devices have made of them."""
        for path, wanted in DEVICES.items():
            said = asked(self._on, self.guest, "sh", "-c", f"stat -L -c '%G %a' {path} | sort -u")
            yield Row(f"group and mode of {path}", said.strip(), wanted, said.strip() == wanted)

    def _cycled(self, slot: str, how: str) -> Row:
        count = len(self._statuses)
        began_s = self._on.loop.clock()
        status, _ = self._ran("captain", "slot", "cycle", slot)
        self._until(lambda: any(not _runs(one, slot) for one in self._statuses[count:]), f"{slot}: without its driver")
        self._until(lambda: _runs(self._statuses[-1], slot), f"{slot}: up again")
        took_s = self._on.loop.clock() - began_s
        return Row(f"captain slot cycle {slot}, by {how}", f"up again after {took_s:.0f} s", "up again", status == 0)

    def _ran(self, *words: str) -> tuple[int, str]:
        """A command of operator: its exit code, and what it has said."""
        lines: list[str] = []
        self.guest.told["ran"] = lines.append
        quoted = shlex.join(["runuser", "-u", "operator", "--", *words])
        self.guest.start("ran", "sh", "-c", f"{quoted}; echo ended $?")
        self._until(lambda: lines and lines[-1].startswith("ended "), " ".join(words))
        return int(lines[-1].removeprefix("ended ")), "\n".join(lines[:-1])


def _runs(status: dict[str, Any], slot: str) -> bool:
    return bool(status["interfaces"][slot]["state"] == "up")


def _device_tree(folder: Path) -> Path:
    """QEMU's with a pulse, and what the firmware of a Pi leaves of a HAT."""
    tree = folder / "emulated.dtb"
    shutil.copy(MADE / "pps.dtb", tree)
    subprocess.run(["fdtput", "-c", tree, "/hat"], check=True)
    for name, value in HAT.items():
        subprocess.run(["fdtput", "-t", "s", tree, "/hat", name, value], check=True)
    return tree
