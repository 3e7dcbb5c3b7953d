"""The serving cell: every form of `+CPSI:` that firmware of the SIM82xx gives, as one report.

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

Three traps. Whether a line is of a stand-alone cell says its second field, a word or a number, and not the count of
fields. RSRQ and RSRP change places. RSRP and RSRQ are tenths, or whole, as the firmware likes: an RSRP below -140 dBm
cannot be whole (27.007 clause 8.69 ends there); the SNR keeps the scale of its own line.

Source: SIMCom AT command manual of the SIM82xx V1.02 and of the SIM8200 V1.00.01 (clause 4.2.14).
"""

from collections.abc import Iterable
from enum import Enum
from typing import NamedTuple

from board.errors import ProtocolError
from drivers.wire.at_fields import fields, number_or_none

PREFIX = "+CPSI"

# By <dlbw> and <ulbw> of LTE.
LTE_BANDWIDTHS_KHZ = (1400, 3000, 5000, 10000, 15000, 20000)

WEAKEST_DBM = -140  # that RSRP can have

_NO_LEG = "NOT IN EN-DC CONNECTED MODE"


class Access(Enum):
    """The radio access that serves."""

    NONE = "no service"
    GSM = "gsm"
    WCDMA = "wcdma"
    LTE = "lte"
    NSA = "5g-nsa"  # LTE with an NR leg: EN-DC
    SA = "5g-sa"


class Strength(NamedTuple):
    """How a cell is received; None where the modem does not say."""

    rsrp_dbm: float | None = None
    rsrq_db: float | None = None
    rssi_dbm: float | None = None
    snr_db: float | None = None


class Leg(NamedTuple):
    """The NR cell of EN-DC. channel is its NR-ARFCN."""

    physical_cell: int | None
    band: str
    channel: int | None
    strength: Strength


class Cell(NamedTuple):
    """What serves.

    mode           of the modem: Online, Offline, Low Power Mode, Factory Test Mode, Reset.
    plmn           MCC-MNC; 01 and 001 are different networks.
    area           tracking or location area code.
    cell           identity in its network. physical_cell: PCI, or PSC of WCDMA.
    channel        EARFCN, NR-ARFCN or UARFCN.
    downlink_khz, uplink_khz  bandwidths, of LTE.
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
    """The cell of all lines that answer AT+CPSI?. Raises ProtocolError."""
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
        raise ProtocolError(f"an NR leg beside a cell of {cell.access.value}")
    return cell._replace(access=Access.NSA, leg=leg)


def _line(line: str) -> Cell | Leg | None:
    """One line; None where it says that there is no leg."""
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
            raise ProtocolError(f"{line[:80]!r}: {name[:20]!r} is no radio access that is known")


def _common(access: Access, columns: list[str], line: str) -> Cell:
    """The columns that every stand-alone cell begins with."""
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
    is_old = columns[0] == "NR5G"  # no column for the band, and a whole SNR
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
    """Without strengths: the manual gives RSCP and Ec/Io no unit."""
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
        raise ProtocolError(f"{line[:80]!r}: {text[:20]!r} is no MCC-MNC")
    return text


def _bandwidth(text: str, line: str) -> int | None:
    at = number_or_none(text, line)
    return LTE_BANDWIDTHS_KHZ[at] if at is not None and 0 <= at < len(LTE_BANDWIDTHS_KHZ) else None


def _scale(rsrp: int | None) -> int:
    return 10 if rsrp is not None and abs(rsrp) > -WEAKEST_DBM else 1


def _over(value: int | None, scale: int) -> float | None:
    return None if value is None else value / scale
