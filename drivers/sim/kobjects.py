"""Kernel objects as files: attributes and links in /sys, nodes in /dev."""

import os
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from drivers.sim.uevents import UeventSender


class Kobject(NamedTuple):
    """Device of the simulated kernel.

    folder      below /sys/devices.
    links       links in /sys and /dev to the folder, or to the pty of the simulator.
    properties  properties of its uevents.
    """

    folder: Path
    subsystem: str
    links: tuple[Path, ...]
    properties: Mapping[str, str]


class Kobjects:
    """Creates and removes kernel objects, each with its uevent. A link is created after everything that it leads to."""

    def __init__(self, sys: Path, dev: Path, uevents: UeventSender) -> None:
        self.sys = sys
        self.dev = dev
        self._uevents = uevents

    def add(
        self,
        folder: Path,
        subsystem: str,
        attributes: Mapping[str, object],
        found_at: str = "",
        node: tuple[str, str] = ("", ""),
        /,
        **properties: str,
    ) -> Kobject:
        """Create an object and send its uevent.

        folder      absolute path.
        attributes  files with one line each.
        found_at    its link in /sys: `bus/usb/devices/1-1`, `class/tty/ttyUSB2`.
        node        its name in /dev, and the target of that link; an empty target creates a plain file.
        properties  properties of its uevents, in addition to the common ones.
        """
        folder.mkdir(parents=True)
        for name, value in attributes.items():
            (folder / name).write_text(f"{value}\n")
        links = []
        if node[0]:
            properties["DEVNAME"] = node[0]
            links.append(self._node(*node))
        if found_at:
            links.append(_link(self.sys / found_at, folder))
        made = Kobject(folder, subsystem, tuple(links), properties)
        self._tell("add", made)
        return made

    def remove(self, one: Kobject) -> None:
        """Remove an object, and send its uevent; its children must have been removed before."""
        for link in reversed(one.links):
            link.unlink()
        shutil.rmtree(one.folder)
        self._tell("remove", one)

    def bind(self, one: Kobject, driver: str) -> None:
        """Bind a driver to an object."""
        home = self.sys / "bus" / one.subsystem / "drivers" / driver
        home.mkdir(parents=True, exist_ok=True)
        _link(one.folder / "driver", home)
        self._tell("bind", one, DRIVER=driver)

    def _tell(self, action: str, one: Kobject, **more: str) -> None:
        devpath = f"/{one.folder.relative_to(self.sys)}"
        self._uevents.send(action, devpath, one.subsystem, **one.properties, **more)

    def _node(self, name: str, target: str) -> Path:
        path = self.dev / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if target:
            path.symlink_to(target)
        else:
            path.touch()
        return path


def _link(path: Path, target: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.symlink_to(os.path.relpath(target, path.parent))
    return path
