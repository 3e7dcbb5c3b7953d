"""Simulated modem: tty of a USB gadget, and unsolicited messages."""

import os
import pty
import tty

import pytest

from drivers.sim.modem.modem import SimulatedModem


@pytest.fixture
def modem(loop):
    # One end of a pty takes the place of the gadget's tty; the other end is the host.
    host, gadget = pty.openpty()
    tty.setraw(gadget)
    os.set_blocking(host, False)
    modem = SimulatedModem(loop, lambda device: None, lambda: None, path=os.ttyname(gadget))
    os.close(gadget)
    modem.host = host
    yield modem
    modem.close()
    os.close(host)


def heard(modem, loop, octets):
    """Return True if the host has received these octets."""
    said = b""

    def is_heard():
        nonlocal said
        try:
            said += os.read(modem.host, 4096)
        except OSError:
            return False
        return octets in said

    loop.run_until(is_heard)
    return said


def test_it_speaks_at_the_tty_of_a_gadget(modem, loop):
    modem.supplied(True)
    heard(modem, loop, b"RDY\r\n")
    os.write(modem.host, b"AT\r")
    assert heard(modem, loop, b"OK\r\n").endswith(b"AT\r\r\nOK\r\n")


def test_a_tty_that_is_not_there_yet_is_waited_for_without_a_busy_loop(loop, tmp_path):
    modem = SimulatedModem(loop, lambda device: None, lambda: None, path=str(tmp_path / "ttyGS2"))
    modem.supplied(True)
    turns, now = 0, loop.now
    while loop.now < now + 100:
        loop.turn()
        turns += 1
    assert turns < 300
    modem.close()
    loop.run_for(100)
    assert loop.delay() is None
