"""What a set of options is for the box: files that are laid over /etc and /run at each start."""

import ipaddress
from typing import NamedTuple

from firmware.box.box_file import PSK, BoxOptions, Ethernet, Wifi

SET = "/data/owner/current"


class SystemFile(NamedTuple):
    """A file. target: of a symbolic link, which then has no text."""

    text: str = ""
    mode: int = 0o644
    target: str = ""


def system_files(options: BoxOptions, files: set[str]) -> dict[str, SystemFile]:
    """Files by their path from the root. files: names in the set."""
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
    """Of the station's unit and of the serial console's."""
    lines = []
    if "captain.toml" in files:
        lines.append(f"CAPTAIN_CONFIG={SET}/captain.toml")
    if "board.toml" in files:
        lines.append(f"CAPTAIN_BOARD={SET}/board.toml")
    if not options.console.shell:
        lines.append("CAPTAIN_SHELL=")
    return "".join(f"{line}\n" for line in lines)


def _wifi(wifi: Wifi) -> str:
    """Source: wpa_supplicant.conf(5). The name in hexadecimal, so that no letter of it means anything."""
    secret = str(wifi.psk or wifi.password or "")
    lines = [f"ssid={wifi.ssid.encode().hex()}", *(["scan_ssid=1"] if wifi.hidden else [])]
    if not secret:
        lines.append("key_mgmt=NONE")
    elif PSK.fullmatch(secret):  # made of name and password for WPA2; WPA3 needs the password itself
        lines += ["key_mgmt=WPA-PSK WPA-PSK-SHA256", f"psk={secret.lower()}", "ieee80211w=1"]
    else:
        lines += ["key_mgmt=WPA-PSK WPA-PSK-SHA256 SAE", f'psk="{secret}"', "ieee80211w=1"]
    inside = "".join(f"    {line}\n" for line in lines)
    return f"country={wifi.country}\nctrl_interface=/run/wpa_supplicant\nnetwork={{\n{inside}}}\n"


def _ethernet(wanted: Ethernet) -> str:
    """Source: systemd.network(5). Over 20-eth0.network."""
    # A second address of IPv4 would be told by mDNS, too; IPv6 needs its own.
    lines = ["[Network]", "DHCP=no", "LinkLocalAddressing=ipv6", f"Address={ipaddress.ip_interface(wanted.address)}"]
    lines += [f"Gateway={wanted.gateway}"] if wanted.gateway else []
    lines += [f"DNS={address}" for address in wanted.dns]
    return "".join(f"{line}\n" for line in lines)
