"""Why the service of updates has not done it, in words that a person can do something with."""

import re

import pytest

from firmware.update.reason import LOG, REASONS, WORN, reason

# RAUC 1.10, whose bundle was pulled out with its drive: github.com/rauc/rauc, 1452.
ENDED = """ 70% Copying image to boot.0 done.
 73% Copying image to rootfs.0
RAUC service disappeared
D-Bus error while installing `/data/update/fetched/bundle.raucb`
"""
# RAUC 0.1.1: the same, 104.
NOT_STARTED = """Error creating proxy: Error calling StartServiceByName for de.pengutronix.rauc: \
GDBus.Error:org.freedesktop.DBus.Error.Spawn.ChildExited: Launch helper exited with unknown return code 1
D-Bus error while installing `/data/update/fetched/bundle.raucb`
"""
# RAUC 1.1: the same, 491.
SIGNALLED = """rauc-Message: 13:31:51.894: rauc mark: rauc status: error retrieving slot status via D-Bus: error creating \
proxy: Error calling StartServiceByName for de.pengutronix.rauc: \
GDBus.Error:org.freedesktop.DBus.Error.Spawn.ChildSignaled: Process de.pengutronix.rauc received signal 5
"""


DOWN, SLOW, GONE, NO_BUS, HANDLER = range(5)  # of REASONS


@pytest.mark.parametrize(
    ("said", "words"),
    [
        (ENDED, GONE),
        ("D-Bus error while installing `x`: GDBus.Error:org.freedesktop.DBus.Error.NoReply: Message recipient "
         "disconnected from message bus without replying", GONE),
        ("GDBus.Error:org.freedesktop.DBus.Error.NoReply", GONE),
        ("GDBus.Error:org.freedesktop.DBus.Error.NoReply: Did not receive a reply. Possible causes include: the remote "
         "application did not send a reply", SLOW),
        (NOT_STARTED, DOWN),
        (SIGNALLED, DOWN),
        ("Failed to get property Operation on interface de.pengutronix.rauc.Installer: Could not activate remote peer "
         "'de.pengutronix.rauc': startup job failed", DOWN),
        ("Failed to connect to bus: No such file or directory", NO_BUS),
        ("rauc status: error creating proxy: Could not connect: No such file or directory", NO_BUS),
        ("Failed to get property Operation on interface x: Connection timed out", SLOW),
        ("GDBus.Error:org.freedesktop.DBus.Error.TimedOut: it took too long", SLOW),
        ("LastError: Handler error: Failed to run pre-install handler: Child process exited with code 1", HANDLER),
    ],
)  # fmt: skip
def test_reason_of_d_bus_is_told_in_words_with_a_remedy(said: str, words: int):
    told = reason(said)
    assert told == REASONS[words][1:]
    assert not re.search(r"GDBus|org\.freedesktop|D-Bus error while", f"{told}")
    assert told.hint


def test_reason_of_rauc_is_told_as_it_is():
    said = "Failed updating slot rootfs.1: failed to write image: Input/output error"
    told = reason(f"99% Updating slots failed.\nLastError: Installation error: {said}\nInstalling `x` failed\n")
    assert told.words == f"Installation error: {said}"
    assert told.hint == WORN


@pytest.mark.parametrize(
    ("said", "words"),
    [
        ("GDBus.Error:org.gtk.GDBus.UnmappedGError.Quark._r_5finstall.Code3: no such thing", "no such thing"),
        ("GDBus.Error:de.pengutronix.rauc.Error.Odd: no such thing", "no such thing"),
        ("GDBus.Error:org.freedesktop.DBus.Error.Failed", "no reason given"),
        ("", "no reason given"),
        ("x" * 5000, "x" * 200),
    ],
)
def test_reason_of_no_known_kind_is_told_without_d_bus_names(said: str, words: str):
    assert reason(said) == (words, LOG)
