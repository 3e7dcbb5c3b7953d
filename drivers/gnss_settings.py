"""What a u-blox receiver is told to be: groups of configuration keys and their values, from the options.

Source: u-blox F9 HPG 1.32 interface description, clause 6, and integration manual, clauses 3.1.5 and 3.9.
"""

from typing import NamedTuple

from drivers.gnss_options import GnssOptions
from drivers.wire.ubx_keys import KEYS
from drivers.wire.ubx_values import Items

# CFG-NAVSPG-DYNMODEL
DYNAMICS = {"portable": 0, "stationary": 2, "pedestrian": 3, "automotive": 4, "sea": 5, "airborne": 6}

# One pulse a second, its rising edge where a second of UTC begins, 100 ms long; without satellites none at all, which
# is the simplest sign that it is worth nothing.
PULSE: dict[str, int] = {
    "CFG-TP-PULSE_DEF": 0,  # by period
    "CFG-TP-PULSE_LENGTH_DEF": 1,  # by length
    "CFG-TP-TP1_ENA": 1,
    "CFG-TP-SYNC_GNSS_TP1": 1,
    "CFG-TP-USE_LOCKED_TP1": 1,
    "CFG-TP-ALIGN_TO_TOW_TP1": 1,
    "CFG-TP-POL_TP1": 1,
    "CFG-TP-TIMEGRID_TP1": 0,  # UTC
    "CFG-TP-PERIOD_TP1": 1_000_000,  # us
    "CFG-TP-PERIOD_LOCK_TP1": 1_000_000,
    "CFG-TP-LEN_TP1": 0,
    "CFG-TP-LEN_LOCK_TP1": 100_000,
}


class Group(NamedTuple):
    """Keys that belong together.

    is_needed  without them the receiver is of no use; the others may be unknown to its firmware.
    """

    name: str
    items: Items
    is_needed: bool = False


def groups(options: GnssOptions) -> list[Group]:
    """All that a receiver is told, in this order."""
    port = options.own_port.upper()
    once_a_second = options.rate_hz  # a message comes with every so many epochs
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


def baud(options: GnssOptions) -> Group | None:
    """The rate of the UART that the receiver is at; USB and I2C have none."""
    if options.own_port in ("usb", "i2c"):
        return None
    return _group("baud", {f"CFG-{options.own_port.upper()}-BAUDRATE": options.rate_baud}, is_needed=True)


def _group(name: str, values: dict[str, int], is_needed: bool = False) -> Group:
    return Group(name, tuple((KEYS[key].number, value) for key, value in values.items()), is_needed)
