#!/bin/bash -e
# Installs the Debian packages of files/, and sets the card up for its board. pi-gen's config may export CAPTAIN_BOARD
# and CAPTAIN_PI, the generation of the Raspberry Pi.
# Not in tmp: on_chroot mounts an empty one.
mkdir -p "$ROOTFS_DIR/var/cache/captain"
cp files/*.deb "$ROOTFS_DIR/var/cache/captain/"
on_chroot <<EOF
apt-get install --yes /var/cache/captain/*.deb
captain box setup --write --board "${CAPTAIN_BOARD:-quad}" --pi "${CAPTAIN_PI:-4}"
rm -r /var/cache/captain
EOF
