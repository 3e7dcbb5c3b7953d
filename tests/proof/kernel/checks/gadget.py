"""A USB device of our making: the kernel's gadget on its dummy host controller, with a vendor's ids, plugged and pulled.

Each controller has one port, on a bus of its own. Source: the kernel's Documentation/usb/gadget_configfs.rst.
"""

from collections.abc import Sequence
from pathlib import Path

from tests.proof.kernel.checks.kernel import CONFIGFS, load

CONTROLLERS = 3
FOLDER = CONFIGFS / "usb_gadget"
HIGH_SPEED = "high-speed"

MODEM = "1e0e:9001"


class Gadget:
    """A device with functions as configfs names them, in the order of its interfaces: `gser.0`, `acm.0`, `rndis.0`.

    place  where it is plugged in, by topology.
    """

    def __init__(
        self, ids: str, functions: Sequence[str], controller: int = 0, names: tuple[str, str] = ("", "")
    ) -> None:
        load("dummy_hcd", num=CONTROLLERS)
        load("libcomposite")
        self._controller = f"dummy_udc.{controller}"
        (bus,) = Path(f"/sys/devices/platform/dummy_hcd.{controller}").glob("usb*")
        self.place = f"{bus.name.removeprefix('usb')}-1"
        self._folder = FOLDER / f"g{controller}"
        self._functions = [self._folder / "functions" / name for name in functions]
        vendor, product = ids.split(":")
        configuration, words = self._folder / "configs/c.1", self._folder / "strings/0x409"
        for folder in (self._folder, configuration, words, *self._functions):
            folder.mkdir()
        (self._folder / "idVendor").write_text(f"0x{vendor}")
        (self._folder / "idProduct").write_text(f"0x{product}")
        (self._folder / "max_speed").write_text(HIGH_SPEED)
        for name, text in zip(("manufacturer", "product"), names, strict=True):
            (words / name).write_text(text)
        for folder in self._functions:
            (configuration / folder.name).symlink_to(folder)

    def __enter__(self) -> "Gadget":
        return self

    def __exit__(self, *_: object) -> None:
        """Who has one of its ttys closes it first: the kernel waits for that."""
        self.unplug()
        configuration, words = self._folder / "configs/c.1", self._folder / "strings/0x409"
        for folder in self._functions:
            (configuration / folder.name).unlink()
            folder.rmdir()
        for folder in (configuration, words, self._folder):
            folder.rmdir()

    @property
    def is_plugged(self) -> bool:
        return (self._folder / "UDC").read_text().strip() != ""

    def plug(self) -> None:
        """The host sees it a moment later, and asks it what it is."""
        (self._folder / "UDC").write_text(self._controller)

    def unplug(self) -> None:
        """Idempotent."""
        if self.is_plugged:
            (self._folder / "UDC").write_text("\n")

    def tty(self, function: int) -> str:
        """Path of the device's own end of a serial function."""
        return f"/dev/ttyGS{(self._functions[function] / 'port_num').read_text().strip()}"

    def network_device(self, function: int) -> str:
        """Name of the device's own end of a network function."""
        return (self._functions[function] / "ifname").read_text().strip()


def modem_gadget(names: tuple[str, str] = ("", "")) -> Gadget:
    """A SIM8202G in its first composition, whose four serial functions option binds."""
    load("option")
    return Gadget(MODEM, [f"gser.{number}" for number in range(4)], names=names)
