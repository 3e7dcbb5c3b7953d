"""Why the service of updates has not done it, in words that a person can do something with."""

import re

import pytest

from firmware.box.update_reason import LOG, reason

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


@pytest.mark.parametrize(
    ("said", "words"),
    [
        (ENDED, "has ended meanwhile"),
        ("D-Bus error while installing `x`: GDBus.Error:org.freedesktop.DBus.Error.NoReply: Message recipient "
         "disconnected from message bus without replying", "has ended meanwhile"),
        ("GDBus.Error:org.freedesktop.DBus.Error.NoReply", "has ended meanwhile"),
        ("GDBus.Error:org.freedesktop.DBus.Error.NoReply: Did not receive a reply. Possible causes include: the remote "
         "application did not send a reply", "does not answer in time"),
        (NOT_STARTED, "does not start"),
        (SIGNALLED, "does not start"),
        ("Failed to get property Operation on interface de.pengutronix.rauc.Installer: Could not activate remote peer "
         "'de.pengutronix.rauc': startup job failed", "does not start"),
        ("Failed to connect to bus: No such file or directory", "D-Bus, by which"),
        ("rauc status: error creating proxy: Could not connect: No such file or directory", "D-Bus, by which"),
        ("Failed to get property Operation on interface x: Connection timed out", "does not answer in time"),
        ("GDBus.Error:org.freedesktop.DBus.Error.TimedOut: it took too long", "does not answer in time"),
        ("LastError: Handler error: Failed to run pre-install handler: Child process exited with code 1", "has not been well"),
    ],
)  # fmt: skip
def test_what_d_bus_says_is_told_in_words_and_with_what_to_do(said: str, words: str):
    told = reason(said)
    assert words in told.words
    assert not re.search(r"GDBus|org\.freedesktop|D-Bus error while", f"{told}")
    assert told.hint


def test_what_rauc_itself_says_of_an_installation_is_told_as_it_is():
    said = "Failed updating slot rootfs.1: failed to write image: Input/output error"
    told = reason(f"99% Updating slots failed.\nLastError: Installation error: {said}\nInstalling `x` failed\n")
    assert told.words == f"Installation error: {said}"
    assert "the card is worn out" in told.hint


@pytest.mark.parametrize(
    ("said", "words"),
    [
        ("GDBus.Error:org.gtk.GDBus.UnmappedGError.Quark._r_5finstall.Code3: no such thing", "no such thing"),
        ("GDBus.Error:de.pengutronix.rauc.Error.Odd: no such thing", "no such thing"),
        ("GDBus.Error:org.freedesktop.DBus.Error.Failed", "it gives no reason"),
        ("", "it gives no reason"),
        ("x" * 5000, "x" * 200),
    ],
)
def test_what_nobody_has_foreseen_is_told_without_d_bus_names(said: str, words: str):
    assert reason(said) == (words, LOG)
