"""Each network of the box, looked at from outside: what it lets in, what it says, and what it lets through."""

import ipaddress
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import NamedTuple

from tests.proof.image import packets
from tests.proof.image.machine import BARE_VIRT, LIMIT_S, LOADER, NotSeenError, Ports, owned, powered
from tests.proof.image.neighbour import Neighbour, answers_echo, tcp_scan, udp_scan
from tests.proof.image.packets import IPV4, TCP, UDP
from tests.proof.image.root_shell import EXTRA, RootShell
from tests.proof.image.rows import Options, Row
from tests.proof.image.wire import MAKERS, ONE_DRIVER, QEMUS, Wire

ALL = range(1, 65536)
FEW = (22, 53, 67, 68, 80, 123, 323, 546, 5353, 5355, 5555, 5556, 5557, 5558, 8947)
LISTED = {22, 5555, 5556, 5557, 5558}
SERVERS = (53, 67, 547)  # of DNS, DHCP and DHCPv6: a firewall may let in what comes from there
CLIENT6 = 546  # of DHCPv6, let in where users are; the network says whether its client is at work
MODEM, RADIO = "wwan0", "usb0"
RESOLVED = "journalctl -b -n 30 -u systemd-resolved -u systemd-networkd"
TRIES = 20  # of questions by multicast: who comes late to a group has not heard them
ALONE = ipaddress.IPv4Address("169.254.7.7")  # of who has none by DHCP either; RFC 3927


class Network(NamedTuple):
    """A network device of the box.

    is_near  who is there is a user; else only replies come in.
    address  how its hardware address begins.
    """

    name: str
    device: str
    network: str
    is_near: bool
    address: bytes = QEMUS


NETWORKS = (
    Network("eth0", "virtio-net-pci", "192.0.2.0/24", True),
    Network("wlan0", "virtio-net-pci", "198.51.100.0/24", True),
    # The SOM301-E's. With an address of a maker's own the kernel calls it eth, as it does the board's port.
    Network(RADIO, "usb-net", "192.168.1.0/24", False, MAKERS),
    Network(MODEM, "virtio-net-pci", "203.0.113.0/24", False),
)


def _asked(name: str, kind: int = 1) -> bytes:
    """A question of DNS, mDNS and LLMNR. Source: RFC 1035, 4.1."""
    labels = b"".join(bytes((len(word),)) + word.encode() for word in name.split("."))
    return b"\0\7\0\0\0\1\0\0\0\0\0\0" + labels + b"\0" + bytes((0, kind)) + b"\0\1"


# What such a service would answer: DNS, NTP (RFC 5905: client, version 4), chronyd's commands (candm.h of chrony 4:
# version 6, request 0), mDNS and LLMNR.
QUESTIONS = {
    53: _asked("localhost"),
    123: b"\x23" + bytes(47),
    323: bytes((6, 1, 0, 0)) + bytes(400),
    5353: _asked("captain.local"),
    5355: _asked("captain"),
}


def rows(card: Path, folder: Path, options: Options) -> Iterator[Row]:
    own = owned(card, folder, {})
    ports = FEW if options.is_short else ALL
    shell = RootShell(folder)
    wires = [Wire(folder, one.name, number, one.device, one.address) for number, one in enumerate(NETWORKS)]
    words = [*shell.words, "-device", "qemu-xhci,id=xhci", *(word for wire in wires for word in wire.words)]
    with ExitStack() as opened:
        guest = opened.enter_context(powered(own, folder, words, machine=_without_network))
        opened.callback(shell.close)
        for wire in wires:
            opened.callback(wire.close)
        neighbours = {one.name: Neighbour(wire, one.network) for one, wire in zip(NETWORKS, wires, strict=True)}
        neighbours["eth0"].gives_lease = False
        for wire in wires:
            wire.start()
        guest.stop_loader(f"{EXTRA} {ONE_DRIVER}")
        shell.open()
        yield _named(shell, wires[[one.name for one in NETWORKS].index(RADIO)])
        _name(shell, wires)
        shell.run(
            "until systemctl is-active -q captain.service && systemctl is-active -q ssh.service; do sleep 1; done", 600
        )
        yield from _alone(shell, neighbours["eth0"])
        for one in NETWORKS:
            yield _lease(shell, one, neighbours[one.name])
        for one in NETWORKS:
            yield from _scanned(one, neighbours[one.name], ports)
            yield from _spoken(one, neighbours[one.name], shell)
        yield _misled(shell, neighbours[RADIO])
        yield from _crossed(neighbours)
        yield _heard(neighbours)
        yield _listening(shell)
        yield from _opened(shell, neighbours)


def _without_network(card: Path, _: Ports) -> list[str]:
    return [*BARE_VIRT, "-bios", str(LOADER), "-drive", f"file={card},format=raw,if=virtio"]


def _named(shell: RootShell, wire: Wire) -> Row:
    """By udev, once it is done with it: the firewall trusts eth0, which has to be the board's port."""
    found = shell.run(f"{_found(wire)}; udevadm settle --timeout 300; {_found(wire)}; echo $is", 600)
    return Row("a network at USB, with an address of its maker", found, "usb*, and never eth*", found.startswith("usb"))


def _name(shell: RootShell, wires: Sequence[Wire]) -> None:
    """What the kernel of a Pi would have named so: a Wi-Fi and a modem are no virtio devices."""
    for wire in wires:
        shell.run(
            f"{_found(wire)};"
            f" [ $is = {wire.name} ] || {{ ip link set $is down; ip link set $is name {wire.name};"
            f" networkctl reconfigure {wire.name}; }}"
        )


def _found(wire: Wire) -> str:
    """Words of a shell: $is is what the guest calls it, once it is there."""
    mac = ":".join(f"{octet:02x}" for octet in wire.guest)
    # What is renamed in between is looked for again.
    return f'until is=$(grep -ls {mac} /sys/class/net/*/address | head -n 1 | cut -d / -f 5); [ -n "$is" ]; do sleep 1; done'


def _alone(shell: RootShell, neighbour: Neighbour) -> Iterator[Row]:
    """Nobody on eth0 gives a lease, as a laptop at the other end of the cable does not."""
    leased = neighbour.guest, neighbour.own
    address = "ip -4 -o addr show dev eth0 | grep -o '169[.]254[.][0-9.]*/16'"
    said = shell.run(f"for i in $(seq 300); do {address} && break; sleep 1; done", 600)
    yield Row("eth0: nobody gives a lease", said or "no address", "169.254.*/16", bool(said))
    if said:
        neighbour.guest, neighbour.own = ipaddress.IPv4Address(said.removesuffix("/16")), ALONE
        mdns = _multicast(neighbour, True)
        yield Row("eth0: captain.local then", " ".join(sorted(mdns)) or "no answer", "mDNS", mdns == {"mDNS"})
        found = tcp_scan(neighbour, 4, FEW)
        yield Row("eth0: ports then", _said(found), _ports(LISTED), set(found) == LISTED)
    neighbour.guest, neighbour.own = leased
    neighbour.gives_lease = True
    shell.run("networkctl reconfigure eth0")


def _lease(shell: RootShell, network: Network, neighbour: Neighbour) -> Row:
    name, address = network.name, neighbour.guest
    if name == MODEM:  # the station sets it up, as the network has told the modem
        shell.run(
            f"ip link set {name} up; ip addr add {address}/24 dev {name};"
            f" ip -6 addr add {neighbour.guest6}/64 dev {name} nodad; networkctl reload"
        )
    said = shell.run(
        f"for i in $(seq 120); do ip -4 -o addr show dev {name} | grep {address}/ && break; sleep 1; done", 600
    )
    what = "keeps the station's address" if name == MODEM else "takes a lease"
    return Row(f"{name}: {what}", str(address) if said else "none", str(address), bool(said))


def _scanned(network: Network, neighbour: Neighbour, ports: Sequence[int]) -> Iterator[Row]:
    """Which ports say anything at all."""
    wanted = LISTED if network.is_near else set()
    goal = _ports(wanted) or "silence"
    of = f"{ports[0]} to {ports[-1]}" if ports is ALL else f"{len(ports)} of them"
    for version in (4, 6):
        found = tcp_scan(neighbour, version, ports)
        is_ok = set(found) == {port for port in found if found[port] == "open"} == wanted
        yield Row(f"{network.name}: TCP ports {of}, IPv{version}", _said(found), goal, is_ok)
        found = udp_scan(neighbour, version, lambda _: b"", ports)
        yield Row(f"{network.name}: UDP ports {of}, IPv{version}", _said(found), "silence", not set(found) - {5353})
        yield _from_servers(network, neighbour, version, ports, of)


def _from_servers(network: Network, neighbour: Neighbour, version: int, ports: Sequence[int], of: str) -> Row:
    """What the firewall lets in by its source alone. of: ports, in words."""
    found = {
        port: said
        for source in SERVERS
        for port, said in udp_scan(neighbour, version, lambda _: b"", ports, source).items()
    }
    allowed = {CLIENT6} if network.is_near and version == 6 else set()
    goal = f"silence, or closed {CLIENT6}" if allowed else "silence"
    what = f"{network.name}: UDP ports {of} from {_ports(set(SERVERS))}, IPv{version}"
    return Row(what, _said(found), goal, not set(found) - allowed - {5353})


def _spoken(network: Network, neighbour: Neighbour, shell: RootShell) -> Iterator[Row]:
    """What answers to a question of its own protocol."""
    found = set(udp_scan(neighbour, 4, lambda port: QUESTIONS[port], QUESTIONS))
    try:
        mdns = " ".join(sorted(_multicast(neighbour, network.is_near)))
    except NotSeenError as error:
        said = shell.run(f"ip addr show dev {network.name}; resolvectl status {network.name}; {RESOLVED}")
        raise NotSeenError(f"{error}\n{said}") from error
    if mdns:
        found.add(5353)
    wanted = {5353} if network.is_near else set()
    yield Row(f"{network.name}: DNS, NTP, chrony, mDNS, LLMNR", _ports(found) or "silence",
              _ports(wanted) or "silence", found == wanted)  # fmt: skip
    echo = [version for version in (4, 6) if answers_echo(neighbour, version)]
    yield Row(f"{network.name}: answers ping", " ".join(f"IPv{version}" for version in echo) or "never",
              "IPv4 IPv6" if network.is_near else "never", echo == ([4, 6] if network.is_near else []))  # fmt: skip
    out = shell.run(f"timeout 60 bash -c 'exec 3<>/dev/tcp/{neighbour.own}/80' && echo out", 120)
    yield Row(
        f"{network.name}: replies to the box come in", "yes" if "out" in out else out[-30:] or "no", "yes", "out" in out
    )


def _multicast(neighbour: Neighbour, is_answered: bool) -> set[str]:
    """Which of mDNS and LLMNR the box answers. Where one is, the other has had its time once that has come."""
    found: set[str] = set()

    def ask() -> None:
        for group, port in (("224.0.0.252", 5355), ("224.0.0.251", 5353)):
            to = ipaddress.IPv4Address(group)
            mac = b"\1\0\x5e" + to.packed[1:]
            neighbour.probe(packets.udp(5353, port, QUESTIONS[port]), UDP, to, mac=mac)

    def is_answer(octets: bytes) -> bool:
        came = packets.packet(octets)
        if came is None or came.protocol != UDP or came.source != neighbour.guest or b"captain" not in came.body:
            return False
        if came.ports[0] == 5355:
            found.add("LLMNR")
        elif came.ports[0] == 5353 and came.body[10] & 0x80:
            found.add("mDNS")
        return "mDNS" in found

    if is_answered:
        for _ in range(TRIES):
            ask()
            with suppress(NotSeenError):
                neighbour.wire.wait(is_answer, LIMIT_S / TRIES, "an answer of mDNS")
                break
        else:
            raise NotSeenError(f"{neighbour.wire.name}: no answer of mDNS to {TRIES} questions, {LIMIT_S:.0f} s")
    else:
        ask()
        for one in neighbour.settle():
            is_answer(packets.frame(bytes(6), bytes(6), IPV4, packets.ip(one.source, one.destination, UDP, one.body)))
    return found


def _misled(shell: RootShell, neighbour: Neighbour) -> Row:
    """The radio's network offers a gateway, by its lease and by an advertisement: it is no way to anywhere."""
    body = packets.router_advertisement(ipaddress.IPv6Network("2001:db8:1::/64"))
    neighbour.probe(body, packets.ICMP6, ipaddress.IPv6Address("ff02::1"), mac=b"\x33\x33\0\0\0\1")
    neighbour.settle(6)
    said = shell.run(
        "ip route show dev usb0; ip -6 route show dev usb0; ip -6 addr show dev usb0 scope global; resolvectl dns usb0"
    )
    bad = [
        line for line in said.splitlines() if "default" in line or "2001:db8:1" in line or str(neighbour.own) in line
    ]
    return Row("usb0: a gateway that it offers", ", ".join(bad) or "is not used", "is not used", not bad)


def _crossed(neighbours: Mapping[str, Neighbour]) -> Iterator[Row]:
    """From the networks that may not come in to what lies behind the box, or to its other addresses."""
    behind = neighbours["eth0"]
    behind.settle()
    for name in (RADIO, MODEM):
        neighbour = neighbours[name]
        found = tcp_scan(neighbour, 4, FEW, behind.guest)
        yield Row(f"{name}: eth0's address of the box", _said(found), "silence", not found)
        for count, port in enumerate(FEW):
            neighbour.probe(packets.tcp(41000 + count, port, packets.SYN), TCP, behind.own)
        neighbour.settle()
        through = [one for one in behind.settle() if one.protocol == TCP and one.ports[0] >= 41000]
        yield Row(f"{name}: a way through to eth0", f"{len(through)} of {len(FEW)}", "0", not through)


def _heard(neighbours: Mapping[str, Neighbour]) -> Row:
    """What the box itself has said to anybody, since it started."""
    near = {one.name for one in NETWORKS if one.is_near}
    heard = {name: {port for _, _, port in one.heard} for name, one in neighbours.items()}
    bad = [f"{name} {port}" for name, ports in heard.items() for port in ports
           if port == 5355 or (port == 5353 and name not in near)]  # fmt: skip
    return Row("LLMNR anywhere, mDNS where only replies come in", ", ".join(bad) or "never", "never", not bad)


def _listening(shell: RootShell) -> Row:
    """Sockets that are open to more than the box itself, whatever the firewall says of them."""
    said = shell.run("ss -Hltun | awk '{print $1, $5}'")
    found = sorted({f"{kind} {at.rpartition(':')[2]}" for kind, at in (line.split() for line in said.splitlines())
                    if not at.startswith(("127.", "[::1]"))})  # fmt: skip
    tcp = {int(one.split()[1]) for one in found if one.startswith("tcp")}
    is_ok = tcp <= LISTED and not {"udp 323", "udp 123", "udp 5355"} & set(found)
    return Row("listens beyond loopback", ", ".join(found), "no more than the list", is_ok)


def _opened(shell: RootShell, neighbours: Mapping[str, Neighbour]) -> Iterator[Row]:
    """The proof that these scans see: without the firewall the same ones find what it had kept away."""
    shell.run("nft flush ruleset")
    for name in (RADIO, MODEM):
        found = tcp_scan(neighbours[name], 4, FEW)
        is_ok = {port for port in found if found[port] == "open"} >= LISTED and "closed" in found.values()
        yield Row(f"{name}: the same scan without the firewall", _said(found), "22 5555 to 5558, others closed", is_ok)


def _said(found: Mapping[int, str]) -> str:
    opened = _ports({port for port in found if found[port] == "open"})
    closed = _ports({port for port in found if found[port] == "closed"})
    return ", ".join(filter(None, (opened, closed and f"closed {closed}"))) or "silence"


def _ports(numbers: set[int]) -> str:
    """In order, runs of more than two as "A to B"."""
    runs: list[list[int]] = []
    for number in sorted(numbers):
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    return " ".join(f"{run[0]} to {run[-1]}" if len(run) > 2 else " ".join(map(str, run)) for run in runs)
