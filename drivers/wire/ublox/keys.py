"""Configuration keys of u-blox generation 9 receivers: those that the driver or the factory sets.

Source: u-blox F9 HPG 1.32 interface description, clause 6.
"""

from typing import NamedTuple


class Key(NamedTuple):
    """Configuration key. Types of value: L boolean, U and E unsigned, I signed."""

    number: int
    name: str
    type: str


_ROWS = """
CFG-TP-PULSE_DEF              20050023 E
CFG-TP-PULSE_LENGTH_DEF       20050030 E
CFG-TP-ANT_CABLEDELAY         30050001 I
CFG-TP-PERIOD_TP1             40050002 U
CFG-TP-PERIOD_LOCK_TP1        40050003 U
CFG-TP-LEN_TP1                40050004 U
CFG-TP-LEN_LOCK_TP1           40050005 U
CFG-TP-TP1_ENA                10050007 L
CFG-TP-SYNC_GNSS_TP1          10050008 L
CFG-TP-USE_LOCKED_TP1         10050009 L
CFG-TP-ALIGN_TO_TOW_TP1       1005000a L
CFG-TP-POL_TP1                1005000b L
CFG-TP-TIMEGRID_TP1           2005000c E
CFG-RATE-MEAS                 30210001 U
CFG-RATE-NAV                  30210002 U
CFG-RATE-TIMEREF              20210003 E
CFG-NAVSPG-DYNMODEL           20110021 E
CFG-ITFM-ENABLE               1041000d L
CFG-UART1-BAUDRATE            40520001 U
CFG-UART2-BAUDRATE            40530001 U
CFG-I2CINPROT-UBX             10710001 L
CFG-I2CINPROT-NMEA            10710002 L
CFG-I2CINPROT-RTCM3X          10710004 L
CFG-I2COUTPROT-UBX            10720001 L
CFG-I2COUTPROT-NMEA           10720002 L
CFG-UART1INPROT-UBX           10730001 L
CFG-UART1INPROT-NMEA          10730002 L
CFG-UART1INPROT-RTCM3X        10730004 L
CFG-UART1OUTPROT-UBX          10740001 L
CFG-UART1OUTPROT-NMEA         10740002 L
CFG-UART2INPROT-UBX           10750001 L
CFG-UART2INPROT-NMEA          10750002 L
CFG-UART2INPROT-RTCM3X        10750004 L
CFG-UART2OUTPROT-UBX          10760001 L
CFG-UART2OUTPROT-NMEA         10760002 L
CFG-USBINPROT-UBX             10770001 L
CFG-USBINPROT-NMEA            10770002 L
CFG-USBINPROT-RTCM3X          10770004 L
CFG-USBOUTPROT-UBX            10780001 L
CFG-USBOUTPROT-NMEA           10780002 L
"""

# Output rate of a message per port. The number is the key for I2C; the next ones are for UART1, UART2, USB and SPI.
_OUTPUTS = """
UBX_NAV_PVT      20910006
UBX_NAV_STATUS   2091001a
UBX_NAV_TIMELS   20910060
UBX_TIM_TP       2091017d
UBX_MON_RF       20910359
UBX_SEC_SIG      20910634
UBX_RXM_RTCM     20910268
NMEA_ID_GGA      209100ba
NMEA_ID_GSA      209100bf
NMEA_ID_RMC      209100ab
NMEA_ID_VTG      209100b0
NMEA_ID_ZDA      209100d8
"""
PORTS: tuple[str, ...] = ("I2C", "UART1", "UART2", "USB", "SPI")


def _read() -> list[Key]:
    keys = [Key(int(number, 16), name, kind) for name, number, kind in map(str.split, _ROWS.strip().splitlines())]
    for name, number in map(str.split, _OUTPUTS.strip().splitlines()):
        keys += [Key(int(number, 16) + at, f"CFG-MSGOUT-{name}_{port}", "U") for at, port in enumerate(PORTS)]
    return keys


KEYS: dict[str, Key] = {one.name: one for one in _read()}
_BY_NUMBER: dict[int, Key] = {one.number: one for one in KEYS.values()}


def key(number: int) -> Key:
    """Return a key by its number. An unknown key has its number as name, and an unsigned value."""
    return _BY_NUMBER.get(number) or Key(number, f"{number:#010x}", "U")
