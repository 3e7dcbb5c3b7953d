"""Firewall of captain-box: the ports that it closes, and its switch."""

import re
from collections.abc import Iterator
from pathlib import Path

from board.runtime.errors import UsageError
from firmware.setup.kept import Kept, is_running
from firmware.setup.setting import Setting

RULES = "usr/share/captain/nftables.conf"
NFT = "usr/sbin/nft"
UNIT = "nftables.service"
DROP_IN = f"etc/systemd/system/{UNIT}.d/captain-setup.conf"
ENABLED = f"etc/systemd/system/sysinit.target.wants/{UNIT}"
TEXT = f"""\
# Written by `captain box setup --firewall`; `captain box setup --undo` removes it.
[Service]
ExecStart=
ExecStart=/{NFT} -f /{RULES}
ExecReload=
ExecReload=/{NFT} -f /{RULES}
"""

_PERMITTED = re.compile(r"\b(tcp|udp)\b.*? dport (\d+)(?:-(\d+))? accept")
_LISTENS = {"tcp": "0A", "udp": "07"}  # states in /proc/net: TCP_LISTEN, TCP_CLOSE
# 127.0.0.0/8, as an IPv6 address too, and ::1; each word in the order of a little-endian processor.
_LOOPBACK = re.compile(r"(?:0{16}FFFF0000)?[0-9A-F]{6}7F|0{24}01000000")


class Firewall:
    """Firewall of a box in place of the rules in /etc/nftables.conf, which stay as they are."""

    def __init__(self, kept: Kept) -> None:
        self._kept = kept

    def lacking(self) -> list[Setting]:
        """Return the firewall, with the ports that it closes, unless it is on.

        Raises UsageError without nftables, StorageError if a file cannot be read.
        """
        if not (self._kept.root / NFT).exists():
            raise UsageError("--firewall: nftables is not installed", "sudo apt install nftables")
        is_on = self._kept.read(DROP_IN) == TEXT.encode() and self._is_enabled()
        closed = " ".join(self._closed()) or "no port that is open now"
        reason = f"on eth0 and wlan0, closes {closed}; on other networks, all ports; forwards no packets"
        return [] if is_on else [Setting(f"/{DROP_IN}", f"rules of /{RULES}", reason)]

    def make(self, kept: Kept) -> None:
        """Switch it on; at once if systemd runs. Raises StationError if that fails."""
        was_enabled = self._is_enabled()
        kept.write(DROP_IN, TEXT.encode())
        kept.reload()
        now = ["--now"] if is_running(kept.root) else []
        if not was_enabled:
            kept.run(["systemctl", "enable", *now, UNIT], ["systemctl", "disable", *now, UNIT])
        elif now:
            kept.run(["systemctl", "restart", UNIT], ["systemctl", "restart", UNIT])

    def _is_enabled(self) -> bool:
        return (self._kept.root / ENABLED).is_symlink()

    def _closed(self) -> Iterator[str]:
        """Yield ports where programs listen for other machines, and that the rules do not permit."""
        permitted = set()
        for kind, first, last in _PERMITTED.findall((self._kept.read(RULES) or b"").decode()):
            permitted |= {(kind, port) for port in range(int(first), int(last or first) + 1)}
        for kind in _LISTENS:
            yield from (
                f"{kind}/{port}" for port in sorted(_open(self._kept.root, kind)) if (kind, port) not in permitted
            )


def _open(root: Path, kind: str) -> set[int]:
    found = set()
    for name in (kind, f"{kind}6"):
        try:
            rows = (root / "proc/net" / name).read_text().splitlines()[1:]
        except OSError:  # a kernel without IPv6
            continue
        for row in rows:
            local, state = row.split()[1], row.split()[3]
            address, _, port = local.partition(":")
            if state == _LISTENS[kind] and not _LOOPBACK.fullmatch(address):
                found.add(int(port, 16))
    return found
