"""RAUC's service as a script: what it says of slots and of an installation, and what it was asked."""

import json
from pathlib import Path

# As RAUC 1.13 says it, of a box whose slot B was updated once.
STATUS = {
    "compatible": "captain trixie quad",
    "variant": "",
    "booted": "A",
    "boot_primary": "rootfs.1",
    "slots": [
        {
            "rootfs.1": {
                "class": "rootfs",
                "device": "/dev/disk/by-partuuid/43505401-03",
                "type": "ext4",
                "bootname": "B",
                "state": "inactive",
                "parent": None,
                "mountpoint": None,
                "boot_status": "good",
                "slot_status": {
                    "bundle": {"compatible": "captain trixie quad", "version": "1.2.3", "build": "x"},
                    "checksum": {"sha256": "00", "size": 4796416},
                    "installed": {"transaction": "t", "timestamp": "2026-11-22T20:01:02Z", "count": 1},
                    "activated": {"timestamp": "2026-11-22T20:01:03Z", "count": 1},
                    "status": "ok",
                },
            }
        },
        {
            "rootfs.0": {
                "class": "rootfs",
                "device": "/dev/disk/by-partuuid/43505401-02",
                "type": "ext4",
                "bootname": "A",
                "state": "booted",
                "parent": None,
                "mountpoint": "/",
                "boot_status": "good",
            }
        },
    ],
}
TAKEN = """installing
  0% Installing
  0% Determining slot states
 10% Determining slot states done.
 10% Checking bundle
 20% Checking bundle done.
 30% Updating slots
 64% Copying image to rootfs.1
 99% Updating slots done.
100% Installing done.
idle
Installing `/data/update/bundle.raucb` succeeded
"""
BROKEN = """installing
  0% Installing
 40% Updating slots
 99% Updating slots failed.
100% Installing failed.
LastError: Installation error: Failed updating slot rootfs.1: failed to write image: Input/output error
Installing `/data/update/bundle.raucb` failed
"""
REFUSED = """installing
  0% Installing
  0% Determining slot states
 10% Determining slot states done.
 10% Checking bundle
 10% Verifying signature
 20% Verifying signature done.
 20% Checking bundle done.
 20% Checking manifest contents
 30% Checking manifest contents done.
 30% Determining target install group
 40% Determining target install group done.
100% Installing failed.
LastError: Compatible mismatch: Expected 'captain trixie quad' but bundle manifest has 'captain trixie quad-other'
idle
Installing `/data/update/another-device-tree.raucb` failed
"""
DENIED = "D-Bus error while installing `x`: GDBus.Error:org.freedesktop.DBus.Error.AccessDenied: Rejected send message"
BUSY = (
    "D-Bus error while installing `x`: GDBus.Error:org.gtk.GDBus.UnmappedGError: Already processing a different method"
)


class Service:
    """rauc as a script: says what is set, and keeps what it was asked."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        path = folder / "rauc"
        path.write_text(
            f'#!/bin/sh\necho "$@" >>{folder}/asked\n'
            f"case $1 in status) cat {folder}/status; cat {folder}/status.err >&2; exit $(cat {folder}/status.code) ;;\n"
            f"*) cat {folder}/install; exit $(cat {folder}/install.code) ;; esac\n"
        )
        path.chmod(0o755)
        bus = folder / "busctl"
        bus.write_text(f"#!/bin/sh\ncat {folder}/bus\n")
        bus.chmod(0o755)
        self.says(json.dumps(STATUS))
        self.installs(TAKEN)
        self.is_at("idle")

    def is_at(self, operation: str, last_error: str = "") -> None:
        lines = [json.dumps({"type": "s", "data": text}) for text in (operation, last_error)]
        (self.folder / "bus").write_text("\n".join(lines) + "\n")

    def says(self, status: str, error: str = "", code: int = 0) -> None:
        for name, text in (("status", status), ("status.err", error), ("status.code", str(code))):
            (self.folder / name).write_text(text)

    def installs(self, said: str, code: int = 0) -> None:
        (self.folder / "install").write_text(said)
        (self.folder / "install.code").write_text(str(code))

    @property
    def asked(self) -> list[str]:
        path = self.folder / "asked"
        return path.read_text().splitlines() if path.exists() else []
