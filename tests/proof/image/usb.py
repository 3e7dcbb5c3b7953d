"""Serial ports at a guest's USB, plugged in and pulled out while it runs: QEMU's own, each with a tty of this machine."""

import json
import socket
from pathlib import Path
from typing import IO, Any

HUBS = ("1", "1.1")  # as on a Pi with the Quad Expander in its first socket: its own hub, and the board's
LIMIT_S = 60.0  # QEMU answers in milliseconds


class Usb:
    """words: of QEMU's command line, for a machine with an XHCI of the id usb."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / "usb.qmp"
        self._socket: socket.socket | None = None
        self._events: list[dict[str, Any]] = []
        hubs = (word for place in HUBS for word in ("-device", f"usb-hub,bus=usb.0,port={place}"))
        self.words = ["-qmp", f"unix:{self._path},server=on,wait=off", *hubs]

    def plug(self, name: str, place: str, tty: str) -> None:
        """A tty, at a place as a board file has it: 1-1.1.4."""
        self._ask("chardev-add", id=name, backend={"type": "serial", "data": {"device": tty}})
        port = place.partition("-")[2]
        self._ask("device_add", driver="usb-serial", id=f"at-{name}", chardev=name, bus="usb.0", port=port)

    def unplug(self, name: str) -> None:
        self._events.clear()
        self._ask("device_del", id=f"at-{name}")
        while not any(event["data"].get("device") == f"at-{name}" for event in self._events):
            self._hear()
        self._ask("chardev-remove", id=name)

    def close(self) -> None:
        if self._socket is not None:
            self._said.close()
            self._socket.close()

    def _ask(self, command: str, **arguments: object) -> None:
        if self._socket is None:
            self._socket = socket.socket(socket.AF_UNIX)
            self._socket.settimeout(LIMIT_S)
            self._socket.connect(str(self._path))
            self._said: IO[bytes] = self._socket.makefile("rb")
            self._hear()  # its greeting
            self._ask("qmp_capabilities")
        self._socket.sendall(json.dumps({"execute": command, "arguments": arguments}).encode() + b"\n")
        while "return" not in (said := self._hear()):
            if "error" in said:
                raise OSError(f"QEMU: {command}: {said['error']['desc']}")

    def _hear(self) -> dict[str, Any]:
        said: dict[str, Any] = json.loads(self._said.readline())
        if said.get("event") == "DEVICE_DELETED":
            self._events.append(said)
        return said
