"""Files of Raspberry Pi Imager with every page filled in."""

from tests.firmware.card.conftest import KEY

# Source: rpi-imager, src/customization_generator.cpp of 2026, with cc_raspberry_pi.
USER_DATA = f"""\
#cloud-config
manage_resolv_conf: false
hostname: captain-7
manage_etc_hosts: true
packages:
- avahi-daemon
apt:
  preserve_sources_list: true
  conf: |
    Acquire {{
      Check-Date "false";
    }};
timezone: Europe/Berlin
keyboard:
  model: pc105
  layout: "de"
users:
- name: pi
  groups: users,adm,dialout,audio,netdev,video,plugdev,cdrom,games,input,gpio,spi,i2c,render,sudo
  shell: /bin/bash
  lock_passwd: false
  passwd: "$5$ABCDEFGH$0123456789"
  ssh_authorized_keys:
    - {KEY}
  sudo: ALL=(ALL) NOPASSWD:ALL
enable_ssh: true
ssh_pwauth: true
rpi:
  interfaces:
    serial: true
runcmd:
  - [ rfkill, unblock, wifi ]
"""
PSK = "0123456789abcdef" * 4
NETWORK = f"""\
network:
  version: 2
  wifis:
    wlan0:
      dhcp4: true
      regulatory-domain: "DE"
      access-points:
        "Café \\"Nord\\"":
          hidden: true
          password: "{PSK}"
      optional: true
"""
# Later versions write the cable too.
CABLE = """\
  ethernets:
    eth0:
      dhcp4: true
      dhcp6: true
      optional: true
"""
NETWORK_WITH_CABLE = NETWORK.replace("  wifis:\n", f"{CABLE}  wifis:\n")
CMDLINE = " cfg80211.ieee80211_regdom=DE ds=nocloud;i=rpi-imager-1784124660514"
