"""Configuration of a u-blox receiver: groups of keys and values, from the options.

Source: u-blox F9 HPG 1.32 interface description, clause 6, and integration manual, clauses 3.1.5 and 3.9.
"""

from typing import NamedTuple

from drivers.gnss.options import GnssOptions
from drivers.wire.ublox.keys import KEYS
from drivers.wire.ublox.values import Items

# Values of CFG-NAVSPG-DYNMODEL by option `dynamics`.
DYNAMICS = {"portable": 0, "stationary": 2, "pedestrian": 3, "automotive": 4, "sea": 5, "airborne": 6}

# One pulse per second, 100 ms long; its rising edge is the start of a second of UTC. Without satellites the receiver
# sends no pulses: that is the simplest sign that the time is not usable.
PULSE: dict[str, int] = {
    "CFG-TP-PULSE_DEF": 0,  # the interval is given as a period, not as a frequency
    "CFG-TP-PULSE_LENGTH_DEF": 1,  # the length is given as a time, not as a duty cycle
    "CFG-TP-TP1_ENA": 1,
    "CFG-TP-SYNC_GNSS_TP1": 1,
    "CFG-TP-USE_LOCKED_TP1": 1,
    "CFG-TP-ALIGN_TO_TOW_TP1": 1,
    "CFG-TP-POL_TP1": 1,
    "CFG-TP-TIMEGRID_TP1": 0,  # pulses are aligned to seconds of UTC
    "CFG-TP-PERIOD_TP1": 1_000_000,  # microseconds, as the other periods and lengths here
    "CFG-TP-PERIOD_LOCK_TP1": 1_000_000,
    "CFG-TP-LEN_TP1": 0,
    "CFG-TP-LEN_LOCK_TP1": 100_000,
}


class KeyGroup(NamedTuple):
    """A group of configuration keys with their values.

    name       name of the group, for error messages.
    is_needed  True: the receiver is useless if its firmware does not know a key. False: unknown keys are skipped.
    """

    name: str
    items: Items
    is_needed: bool = False


def groups(options: GnssOptions) -> list[KeyGroup]:
    """Return all groups of keys for the options, in the order in which they are written."""
    port = options.own_port.upper()
    once_a_second = options.rate_hz  # a key's value is a number of epochs: the receiver sends one message in so many
    pulse: dict[str, int] = {"CFG-TP-TP1_ENA": 0}
    if options.pulse:
        pulse = {**PULSE, "CFG-TP-ANT_CABLEDELAY": options.antenna_delay_ns}
    return [
        _group(
            "ports",
            {
                f"CFG-{port}INPROT-UBX": 1,
                f"CFG-{port}INPROT-RTCM3X": 1,
                f"CFG-{port}OUTPROT-UBX": 1,
                f"CFG-{port}OUTPROT-NMEA": 0,
            },
        ),
        _group("rate", {"CFG-RATE-MEAS": 1000 // options.rate_hz, "CFG-RATE-NAV": 1, "CFG-RATE-TIMEREF": 0}),
        _group("epochs", {f"CFG-MSGOUT-UBX_NAV_PVT_{port}": 1}, is_needed=True),
        _group("navigation", {"CFG-NAVSPG-DYNMODEL": DYNAMICS[options.dynamics]}),
        _group("pulse", pulse),
        _group(
            "messages",
            {
                f"CFG-MSGOUT-UBX_TIM_TP_{port}": int(options.pulse),
                f"CFG-MSGOUT-UBX_NAV_TIMELS_{port}": once_a_second,
                f"CFG-MSGOUT-UBX_NAV_STATUS_{port}": once_a_second,
                f"CFG-MSGOUT-UBX_MON_RF_{port}": once_a_second,
                f"CFG-MSGOUT-UBX_RXM_RTCM_{port}": int(bool(options.corrections)),
            },
        ),
        _group("interference", {"CFG-ITFM-ENABLE": 1, f"CFG-MSGOUT-UBX_SEC_SIG_{port}": once_a_second}),
    ]


def baud(options: GnssOptions) -> KeyGroup | None:
    """Return the group that sets the baud rate of the receiver's UART; None for USB and I2C."""
    if options.own_port in ("usb", "i2c"):
        return None
    return _group("baud", {f"CFG-{options.own_port.upper()}-BAUDRATE": options.rate_baud}, is_needed=True)


def _group(name: str, values: dict[str, int], is_needed: bool = False) -> KeyGroup:
    return KeyGroup(name, tuple((KEYS[key].number, value) for key, value in values.items()), is_needed)
