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
_NEAR = re.compile(r"iifname \{([^}]*)\} jump near")
_ESTABLISHED = "01"  # state in /proc/net/tcp
_SSH = ":0016"
_LISTENS = {"tcp": "0A", "udp": "07"}  # states in /proc/net: TCP_LISTEN, TCP_CLOSE
# 127.0.0.0/8, as an IPv6 address too, and ::1; each word in the order of a little-endian processor.
_LOOPBACK = re.compile(r"(?:0{16}FFFF0000)?[0-9A-F]{6}7F|0{24}01000000")


class Firewall:
    """Firewall of a box in place of the rules in /etc/nftables.conf, which stay as they are."""

    def __init__(self, kept: Kept) -> None:
        self._kept = kept

    def lacking(self) -> list[Setting]:
        """Return the firewall, with the ports that it closes, unless it is on.

        Raises UsageError without nftables or if it would close ssh, StorageError if a file cannot be read.
        """
        if not (self._kept.root / NFT).exists():
            raise UsageError("--firewall: nftables is not installed", "sudo apt install nftables")
        is_on = self._kept.read(DROP_IN) == TEXT.encode() and self._is_enabled()
        if not is_on:
            self._check_ssh()
        closed = " ".join(self._closed()) or "no port that is open now"
        reason = f"on eth0 and wlan0, closes {closed}; on other networks, all ports; forwards no packets"
        return [] if is_on else [Setting(f"/{DROP_IN}", f"rules of /{RULES}", reason)]

    def make(self) -> None:
        """Switch it on; at once if systemd runs. Raises StationError if that fails."""
        was_enabled = self._is_enabled()
        self._kept.write(DROP_IN, TEXT.encode())
        self._kept.reload()
        now = ["--now"] if is_running(self._kept.root) else []
        if not was_enabled:
            self._kept.run(["systemctl", "enable", *now, UNIT], ["systemctl", "disable", *now, UNIT])
        elif now:
            self._kept.run(["systemctl", "restart", UNIT], ["systemctl", "restart", UNIT])

    def _is_enabled(self) -> bool:
        return (self._kept.root / ENABLED).is_symlink()

    def _check_ssh(self) -> None:
        """Raise UsageError if ssh comes over another network than those of the rules."""
        found = _NEAR.search((self._kept.read(RULES) or b"").decode())
        near = set(re.findall(r"[\w*]+", found[1])) if found else set()
        sessions, defaults = _ssh_devices(self._kept.root), self._default_devices()
        far = sessions - near if sessions or defaults & near else defaults
        if far:
            hint = f"write rules of your own into /etc/nftables.conf; example: /{RULES}"
            raise UsageError(
                f"--firewall: closes ssh on {', '.join(sorted(far))}: permits {', '.join(sorted(near))} only", hint
            )

    def _default_devices(self) -> set[str]:
        """Return the devices of default routes, without the modem's, by which no ssh comes."""
        rows = _rows(self._kept.root, "route")
        return {row[0] for row in rows if row[1] == row[7] == "00000000" and not row[0].startswith("wwan")}

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
    for row in [*_rows(root, kind), *_rows(root, f"{kind}6")]:
        address, _, port = row[1].partition(":")
        if row[3] == _LISTENS[kind] and not _LOOPBACK.fullmatch(address):
            found.add(int(port, 16))
    return found


def _ssh_devices(root: Path) -> set[str]:
    """Return the network devices of the ssh sessions to this machine; sudo keeps no $SSH_CONNECTION."""
    found = set()
    for _, local, remote, state, *_ in [*_rows(root, "tcp"), *_rows(root, "tcp6")]:
        if state == _ESTABLISHED and local.endswith(_SSH):
            found.add(_device(root, local.partition(":")[0], remote.partition(":")[0]))
    return found - {"", "lo"}


def _device(root: Path, local: str, remote: str) -> str:
    """Return the device of a connection: by an IPv6 address of this machine, else by the route to the peer."""
    words = [local[at : at + 8] for at in range(0, len(local), 8)]
    address = b"".join(bytes.fromhex(word)[::-1] for word in words).hex()
    own = next((row[5] for row in _rows(root, "if_inet6", 0) if row[0] == address), "")
    peer = int(remote[-8:], 16)  # the end of an IPv4 address in IPv6 is the same
    routes = [
        (int(row[7], 16).bit_count(), row[0])
        for row in _rows(root, "route")
        if peer & int(row[7], 16) == int(row[1], 16)
    ]
    return own or max(routes, default=(0, ""))[1]


def _rows(root: Path, name: str, heads: int = 1) -> list[list[str]]:
    """Return the rows of a table in /proc/net; none if the kernel lacks it, as without IPv6."""
    try:
        return [row.split() for row in (root / "proc/net" / name).read_text().splitlines()[heads:]]
    except OSError:
        return []
