"""Serving cell: one report from all forms of `+CPSI:` of the SIM82xx.

    +CPSI: NO SERVICE,Online
    +CPSI: LTE,<mode>,<MCC>-<MNC>,<TAC>,<cell>,<PCI>,<band>,<EARFCN>,<dlbw>,<ulbw>,<RSRQ>,<RSRP>,<RSSI>,<RSSNR>
    +CPSI: NR5G_NSA,<PCI>,<band>,<ARFCN>,<RSRP>,<RSRQ>,<SNR>[,<scs>,<bandwidth>]      a second line, after LTE
    +CPSI: NR5G_SA,<mode>,<MCC>-<MNC>,<TAC>,<cell>,<PCI>,<band>,<ARFCN>,<RSRP>,<RSRQ>,<SNR>
    +CPSI: WCDMA,<mode>,<MCC>-<MNC>,<LAC>,<cell>,<band>,<PSC>,<UARFCN>,...
    +CPSI: GSM,<mode>,<MCC>-<MNC>,<LAC>,<cell>,<ARFCN and band>,...
  firmware up to V1.00.01:
    +CPSI: NR5G,<PCI>,<ARFCN>,<RSRQ>,<RSRP>,<SNR>                                     a second line, after LTE
    +CPSI: NR5G,<mode>,<MCC>-<MNC>,<TAC>,<cell>,<PCI>,<ARFCN>,<RSRP>,<RSRQ>,<SNR>
    +CPSI: NOT IN EN-DC CONNECTED MODE                                                a second line, after LTE

Three traps:
1. The number of columns does not distinguish an SA cell from an NR leg. The second column does: the mode (a word) or
   the PCI (a number).
2. The order of RSRQ and RSRP differs between the forms.
3. RSRP and RSRQ are in tenths or in whole units, depending on the firmware. An RSRP below -140 dBm must be in tenths,
   because the range ends there (27.007 clause 8.69). The SNR has a fixed scale per form of the line.

Source: SIMCom AT command manual of the SIM82xx V1.02 and of the SIM8200 V1.00.01 (clause 4.2.14).
"""

from collections.abc import Iterable
from enum import Enum
from typing import NamedTuple

from board.runtime.errors import ProtocolError
from drivers.wire.at.fields import fields, number_or_none

PREFIX = "+CPSI"

# Bandwidths of LTE; <dlbw> and <ulbw> are the index.
LTE_BANDWIDTHS_KHZ = (1400, 3000, 5000, 10000, 15000, 20000)

WEAKEST_DBM = -140  # lower end of the range of RSRP

_NO_LEG = "NOT IN EN-DC CONNECTED MODE"


class Access(Enum):
    """Radio access technology of the serving cell."""

    NONE = "no service"
    GSM = "gsm"
    WCDMA = "wcdma"
    LTE = "lte"
    NSA = "5g-nsa"  # LTE with an NR leg (EN-DC)
    SA = "5g-sa"


class Strength(NamedTuple):
    """Signal strength and quality of a cell; None for values that the modem does not report."""

    rsrp_dbm: float | None = None
    rsrq_db: float | None = None
    rssi_dbm: float | None = None
    snr_db: float | None = None


class Leg(NamedTuple):
    """NR cell of an EN-DC connection (5G NSA).

    physical_cell  PCI.
    channel        NR-ARFCN.
    """

    physical_cell: int | None
    band: str
    channel: int | None
    strength: Strength


class Cell(NamedTuple):
    """Serving cell.

    mode           operating mode of the modem: Online, Offline, Low Power Mode, Factory Test Mode, Reset.
    plmn           MCC-MNC; 01 and 001 are different networks.
    area           tracking area code or location area code.
    cell           cell identity in its network.
    physical_cell  PCI; PSC in WCDMA.
    channel        EARFCN, NR-ARFCN or UARFCN.
    downlink_khz, uplink_khz  bandwidths; LTE only.
    leg            NR cell beside an LTE cell.
    """

    access: Access
    mode: str = ""
    plmn: str = ""
    area: int | None = None
    cell: int | None = None
    physical_cell: int | None = None
    band: str = ""
    channel: int | None = None
    downlink_khz: int | None = None
    uplink_khz: int | None = None
    strength: Strength = Strength()
    leg: Leg | None = None


def cell_report(lines: Iterable[str]) -> Cell:
    """Return the serving cell from all lines that answer AT+CPSI?.

    Raises ProtocolError for no serving cell, two serving cells, an NR leg beside a cell other than LTE, and missing
    columns.
    """
    cell: Cell | None = None
    leg: Leg | None = None
    for line in lines:
        found = _line(line)
        if isinstance(found, Leg):
            leg = found
        elif found is not None:
            if cell is not None:
                raise ProtocolError(f"{line[:80]!r}: a second serving cell")
            cell = found
    if cell is None:
        raise ProtocolError("AT+CPSI? was answered without a serving cell")
    if leg is None:
        return cell
    if cell.access is not Access.LTE:
        raise ProtocolError(f"5G NR (EN-DC) beside a serving cell of {cell.access.value}; only LTE can have it")
    return cell._replace(access=Access.NSA, leg=leg)


def _line(line: str) -> Cell | Leg | None:
    """Parse one line; return None for the report that an NR leg is absent."""
    columns = fields(line, PREFIX)
    match columns[0]:
        case "NO SERVICE":
            return Cell(Access.NONE, _column(columns, 1))
        case "LTE":
            return _lte(columns, line)
        case "NR5G" | "NR5G_SA" | "NR5G_NSA":
            is_leg = _column(columns, 1).isdecimal()
            return _leg(columns, line) if is_leg else _stand_alone(columns, line)
        case "WCDMA":
            return _wcdma(columns, line)
        case "GSM":
            return _common(Access.GSM, columns, line)._replace(band=_column(columns, 5))
        case name if name == _NO_LEG:
            return None
        case name:
            raise ProtocolError(f"{line[:80]!r}: unknown radio access: {name[:20]!r}")


def _common(access: Access, columns: list[str], line: str) -> Cell:
    """Parse the columns that are the same for every serving cell."""
    _at_least(5, columns, line)
    return Cell(
        access,
        mode=columns[1],
        plmn=_plmn(columns[2], line),
        area=number_or_none(columns[3], line, 16),
        cell=number_or_none(columns[4], line),
    )


def _lte(columns: list[str], line: str) -> Cell:
    _at_least(14, columns, line)
    rsrq, rsrp, rssi, snr = (number_or_none(text, line) for text in columns[10:14])
    scale = _scale(rsrp)
    return _common(Access.LTE, columns, line)._replace(
        physical_cell=number_or_none(columns[5], line),
        band=columns[6],
        channel=number_or_none(columns[7], line),
        downlink_khz=_bandwidth(columns[8], line),
        uplink_khz=_bandwidth(columns[9], line),
        strength=Strength(_over(rsrp, scale), _over(rsrq, scale), _over(rssi, scale), _over(snr, 1)),
    )


def _stand_alone(columns: list[str], line: str) -> Cell:
    cell = _common(Access.SA, columns, line)
    is_old = columns[0] == "NR5G"  # this form has no column for the band, and its SNR is in whole dB
    _at_least(10 if is_old else 11, columns, line)
    rest = columns[5:6] + ([""] if is_old else []) + columns[6:]
    rsrp, rsrq, snr = (number_or_none(text, line) for text in rest[3:6])
    scale = _scale(rsrp)
    return cell._replace(
        physical_cell=number_or_none(rest[0], line),
        band=rest[1],
        channel=number_or_none(rest[2], line),
        strength=Strength(_over(rsrp, scale), _over(rsrq, scale), None, _over(snr, 1 if is_old else 10)),
    )


def _leg(columns: list[str], line: str) -> Leg:
    if columns[0] == "NR5G":
        _at_least(6, columns, line)
        band, channel, rsrq_text, rsrp_text, snr_text = "", *columns[2:6]
    else:
        _at_least(7, columns, line)
        band, channel, rsrp_text, rsrq_text, snr_text = columns[2:7]
    rsrp, rsrq, snr = (number_or_none(text, line) for text in (rsrp_text, rsrq_text, snr_text))
    scale = _scale(rsrp)
    strength = Strength(_over(rsrp, scale), _over(rsrq, scale), None, _over(snr, 10))
    return Leg(number_or_none(columns[1], line), band, number_or_none(channel, line), strength)


def _wcdma(columns: list[str], line: str) -> Cell:
    """Parse a WCDMA cell, without signal strengths: the manual gives no unit for RSCP and Ec/Io."""
    _at_least(8, columns, line)
    return _common(Access.WCDMA, columns, line)._replace(
        band=columns[5],
        physical_cell=number_or_none(columns[6], line),
        channel=number_or_none(columns[7], line),
    )


def _column(columns: list[str], place: int) -> str:
    return columns[place] if place < len(columns) else ""


def _at_least(count: int, columns: list[str], line: str) -> None:
    if len(columns) < count:
        raise ProtocolError(f"{line[:120]!r}: {len(columns)} columns, not {count}")


def _plmn(text: str, line: str) -> str:
    mcc, _, mnc = text.partition("-")
    if not (mcc.isdecimal() and mnc.isdecimal() and len(mcc) == 3 and 2 <= len(mnc) <= 3):
        raise ProtocolError(f"{line[:80]!r}: invalid MCC-MNC: {text[:20]!r}")
    return text


def _bandwidth(text: str, line: str) -> int | None:
    at = number_or_none(text, line)
    return LTE_BANDWIDTHS_KHZ[at] if at is not None and 0 <= at < len(LTE_BANDWIDTHS_KHZ) else None


def _scale(rsrp: int | None) -> int:
    return 10 if rsrp is not None and abs(rsrp) > -WEAKEST_DBM else 1


def _over(value: int | None, scale: int) -> float | None:
    return None if value is None else value / scale
