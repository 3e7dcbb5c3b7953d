"""System files of a set of options, laid over /etc and /run."""

import ipaddress
from typing import NamedTuple

from firmware.card.box_file import PSK, BoxOptions, Ethernet, Wifi

SET = "/data/owner/current"


class SystemFile(NamedTuple):
    """System file. target: of a symbolic link, which has no text."""

    text: str = ""
    mode: int = 0o644
    target: str = ""


def system_files(options: BoxOptions, files: set[str]) -> dict[str, SystemFile]:
    """Return the system files by path from the root. files: names of the files in the set."""
    found = {"run/captain-image/environment": SystemFile(_environment(options, files))}
    if options.host_name:
        name = options.host_name.lower()
        found["etc/hostname"] = SystemFile(f"{name}\n")
        found["etc/hosts"] = SystemFile(f"127.0.0.1 localhost\n127.0.1.1 {name}\n::1 localhost ip6-localhost\n")
    if options.time_zone:
        found["etc/localtime"] = SystemFile(target=f"/usr/share/zoneinfo/{options.time_zone}")
    if options.time_servers:  # chrony.conf(5), sourcedir
        lines = (f"server {server} iburst\n" for server in options.time_servers)
        found["etc/chrony/sources.d/owner.sources"] = SystemFile("".join(lines))
    if options.wifi:
        found["etc/wpa_supplicant/wpa_supplicant-wlan0.conf"] = SystemFile(_wifi(options.wifi), 0o600)
    if options.eth0:
        found["run/systemd/network/20-eth0.network.d/owner.conf"] = SystemFile(_ethernet(options.eth0))
    return found


def _environment(options: BoxOptions, files: set[str]) -> str:
    """Return the environment of the units of the station and the serial console."""
    lines = []
    if "captain.toml" in files:
        lines.append(f"CAPTAIN_CONFIG={SET}/captain.toml")
    if "board.toml" in files:
        lines.append(f"CAPTAIN_BOARD={SET}/board.toml")
    if not options.console.shell:
        lines.append("CAPTAIN_SHELL=")
    return "".join(f"{line}\n" for line in lines)


def _wifi(wifi: Wifi) -> str:
    """Return wpa_supplicant.conf(5). The SSID is hexadecimal, so that no character of it has a meaning."""
    secret = str(wifi.psk or wifi.password or "")
    lines = [f"ssid={wifi.ssid.encode().hex()}", *(["scan_ssid=1"] if wifi.hidden else [])]
    if not secret:
        lines.append("key_mgmt=NONE")
    elif PSK.fullmatch(secret):  # the PSK is made from name and password for WPA2; WPA3 needs the password itself
        lines += ["key_mgmt=WPA-PSK WPA-PSK-SHA256", f"psk={secret.lower()}", "ieee80211w=1"]
    else:
        lines += ["key_mgmt=WPA-PSK WPA-PSK-SHA256 SAE", f'psk="{secret}"', "ieee80211w=1"]
    inside = "".join(f"    {line}\n" for line in lines)
    return f"country={wifi.country}\nctrl_interface=/run/wpa_supplicant\nnetwork={{\n{inside}}}\n"


def _ethernet(wanted: Ethernet) -> str:
    """Return an addition to 20-eth0.network. Source: systemd.network(5)."""
    # LinkLocalAddressing=ipv6: mDNS would announce a second IPv4 address too; IPv6 needs its link-local address.
    lines = ["[Network]", "DHCP=no", "LinkLocalAddressing=ipv6", f"Address={ipaddress.ip_interface(wanted.address)}"]
    lines += [f"Gateway={wanted.gateway}"] if wanted.gateway else []
    lines += [f"DNS={address}" for address in wanted.dns]
    return "".join(f"{line}\n" for line in lines)
