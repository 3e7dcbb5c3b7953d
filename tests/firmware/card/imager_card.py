"""Files of Raspberry Pi Imager with every page filled in."""

from tests.firmware.card.conftest import KEY

# Source: rpi-imager 2.0, src/customization_generator.cpp.
USER_DATA = f"""\
#cloud-config
hostname: captain-7
manage_etc_hosts: true
packages:
- avahi-daemon
apt:
  conf: |
    Acquire {{
      Check-Date "false";
    }};
timezone: Europe/Berlin
keyboard:
  model: pc105
  layout: "de"
enable_ssh: true
users:
- name: pi
  groups: users,adm,dialout,audio,netdev,video,plugdev,cdrom,games,input,gpio,spi,i2c,render,sudo
  shell: /bin/bash
  lock_passwd: false
  passwd: $5$ABCDEFGH$0123456789
  ssh_authorized_keys:
    - {KEY}
  sudo: ALL=(ALL) NOPASSWD:ALL
ssh_pwauth: true
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
CMDLINE = " cfg80211.ieee80211_regdom=DE ds=nocloud;i=rpi-imager-1784124660514"
