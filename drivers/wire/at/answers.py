"""Parsers of a modem's answers, one for each kind of line.

Each parser raises ProtocolError for a line with invalid syntax.
Sources: 3GPP TS 27.007 (each parser names its clause), SIMCom AT command manual of the SIM82xx V1.02.
"""

import re
from collections.abc import Iterable
from enum import Enum, IntEnum
from ipaddress import IPv4Address, IPv6Address, ip_address
from typing import NamedTuple

from board.runtime.errors import ProtocolError
from drivers.wire.at.fields import fields, number, number_or_none

Address = IPv4Address | IPv6Address


class RegistrationState(IntEnum):
    """Registration state: <stat> of 27.007 clauses 7.2, 10.1.20, 10.1.22 and 10.1.47."""

    NONE = 0
    HOME = 1
    SEARCHING = 2
    DENIED = 3
    UNKNOWN = 4
    ROAMING = 5
    HOME_SMS = 6
    ROAMING_SMS = 7
    EMERGENCY = 8
    HOME_NO_FALLBACK = 9
    ROAMING_NO_FALLBACK = 10


class Registration(NamedTuple):
    """Network registration of one domain: CREG, CGREG, CEREG or C5GREG.

    access  <AcT>: 7 E-UTRAN, 10 and 11 with a 5G core, 12 NG-RAN, 13 E-UTRA with NR.
    """

    domain: str
    state: RegistrationState
    area: int | None = None
    cell: int | None = None
    access: int | None = None

    @property
    def is_registered(self) -> bool:
        """True if packets can be sent: registered at home or roaming."""
        return self.state in (RegistrationState.HOME, RegistrationState.ROAMING)


_REGISTRATION = re.compile(r"\+(C(?:G|E|5G)?REG): ?(.*)")
_ASKED = re.compile(r"\d,\s*\d{1,2}\s*(?:,|$)")


def registration(line: str) -> Registration:
    """Parse a registration: `+CEREG: 2,1,"5A1E","0B28A00C",7`; an unsolicited line lacks the first number.

    The codes of area and cell are hexadecimal, with or without quotes.

    Raises ProtocolError for another line, and for a state that 3GPP TS 27.007 does not define.
    """
    match = _REGISTRATION.match(line)
    if match is None:
        raise ProtocolError(f"{line[:60]!r} is not a registration report")
    columns = fields(line, f"+{match[1]}")
    if _ASKED.match(match[2]):
        columns = columns[1:]
    state = number(columns[0], line)
    if state not in set(RegistrationState):
        raise ProtocolError(f"{line[:60]!r}: unknown registration state: {state}")
    columns += [""] * 3
    # With CGREG, and in states without a network, the later columns have other meanings or are empty.
    area, cell = (number(text, line, 16) if text else None for text in columns[1:3])
    access = number_or_none(columns[3], line) if len(columns) > 3 and columns[3].isdecimal() else None
    return Registration(match[1], RegistrationState(state), area, cell, access)


def operator(line: str) -> str:
    """Return the operator name of AT+COPS? (clause 7.3); empty without an operator."""
    columns = fields(line, "+COPS")
    number(columns[0], line)
    return columns[2] if len(columns) > 2 else ""


def signal_dbm(line: str) -> int | None:
    """Return the RSSI of AT+CSQ (clause 8.5) in dBm; None if unknown, as always in 5G SA.

    Values 100 to 191 are SIMCom's, for TD-SCDMA: -116 dBm plus the value above 100.

    Raises ProtocolError for other numbers than 0 to 31, 99, 100 to 191 and 199.
    """
    columns = fields(line, "+CSQ")
    rssi = number(columns[0], line)
    if 0 <= rssi <= 31:
        return -113 + 2 * rssi
    if 100 <= rssi <= 191:
        return -116 + rssi - 100
    if rssi in (99, 199):
        return None
    raise ProtocolError(f"{line[:60]!r}: invalid RSSI: {rssi}")


# <stat> of SIMCom's +CNSMOD. The values for 5G are not published.
SYSTEM_MODES = ("none", "gsm", "gprs", "edge", "wcdma", "hsdpa", "hsupa", "hspa", "lte")


def system_mode(line: str) -> str:
    """Parse `+CNSMOD: <n>,<stat>`, or the unsolicited `+CNSMOD: <stat>`; an unknown number gives "mode <stat>"."""
    stat = number(fields(line, "+CNSMOD")[-1], line)
    return SYSTEM_MODES[stat] if 0 <= stat < len(SYSTEM_MODES) else f"mode {stat}"


def temperature_c(line: str) -> int:
    """Parse `+CPMUTEMP: 38`, degrees Celsius. Raises ProtocolError outside -60 to 150."""
    celsius = number(fields(line, "+CPMUTEMP")[0], line)
    if not -60 <= celsius <= 150:
        raise ProtocolError(f"{line[:60]!r}: temperature out of range: {celsius}")
    return celsius


class PacketContext(NamedTuple):
    """PDP context, a line of AT+CGDCONT? (clause 10.1.1).

    ip_type  IP, IPV6 or IPV4V6. Missing columns are empty.
    """

    number: int
    ip_type: str = ""
    apn: str = ""


def packet_contexts(lines: Iterable[str]) -> list[PacketContext]:
    """Parse lines `+CGDCONT: 1,"IP","internet","0.0.0.0",0,0`; every column except the first may be missing."""
    found = []
    for line in lines:
        columns = [*fields(line, "+CGDCONT"), "", ""]
        found.append(PacketContext(number(columns[0], line), columns[1].upper(), columns[2]))
    return found


def addresses(lines: Iterable[str]) -> list[Address]:
    """Parse lines `+CGPADDR: 1,"10.1.2.3","..."` (clause 10.1.14); leave out unspecified addresses, such as 0.0.0.0.

    Raises ProtocolError for text that is neither an address nor 16 decimal octets.
    """
    found: list[Address] = []
    for line in lines:
        for text in filter(None, fields(line, "+CGPADDR")[1:]):
            one = _address(text, line)
            if not one.is_unspecified:
                found.append(one)
    return found


def _address(text: str, line: str) -> Address:
    """Parse an address. IPv6 may also be 16 decimal octets, the default form of a modem (+CGPIAF=0)."""
    octets = text.split(".")
    try:
        if len(octets) == 16:
            return IPv6Address(bytes(int(octet) for octet in octets))
        return ip_address(text)
    except ValueError as error:
        raise ProtocolError(f"{line[:80]!r}: invalid address: {text[:45]!r}") from error


class Sim(Enum):
    """State of the SIM: the answer to AT+CPIN? (clause 8.3), or the error in its place (clause 9.2)."""

    READY = "ready"
    PIN = "PIN required"
    PUK = "PUK required"
    ABSENT = "no SIM"
    BUSY = "busy"
    FAILED = "failed"
    LOCKED = "locked to a device or network"
    REFUSED = "refused the PIN"


# PIN2 protects services such as fixed dialling. A request for PIN2 or PUK2 does not affect packet data.
_SIM_STATES = {
    "READY": Sim.READY, "SIM PIN2": Sim.READY, "SIM PUK2": Sim.READY, "SIM PIN": Sim.PIN, "SIM PUK": Sim.PUK,
}  # fmt: skip
_SIM_ERRORS = {
    10: Sim.ABSENT, 11: Sim.PIN, 12: Sim.PUK, 13: Sim.FAILED, 14: Sim.BUSY, 15: Sim.FAILED,
    16: Sim.REFUSED, 17: Sim.READY, 18: Sim.READY,
}  # fmt: skip
_SIM_TEXTS = {
    "sim not inserted": Sim.ABSENT, "sim pin required": Sim.PIN, "sim puk required": Sim.PUK,
    "sim failure": Sim.FAILED, "sim busy": Sim.BUSY, "sim wrong": Sim.FAILED,
    "incorrect password": Sim.REFUSED,
}  # fmt: skip


# States after a wrong PIN: REFUSED, or PUK after the last attempt.
PIN_REFUSED = (Sim.REFUSED, Sim.PUK)


def sim(line: str) -> Sim:
    """Parse `+CPIN: <code>`. Raises ProtocolError for another line or an unknown code."""
    code = line.partition(":")[2].strip()
    if not line.startswith("+CPIN:") or not code:
        raise ProtocolError(f"not a state of a SIM: {line[:60]!r}")
    if code.startswith("PH-"):  # SIM locked to the device, network, provider or company
        return Sim.LOCKED
    if code not in _SIM_STATES:
        raise ProtocolError(f"unknown state of a SIM: {line[:60]!r}")
    return _SIM_STATES[code]


def sim_error(code: int | None, detail: str) -> Sim:
    """Return the state of the SIM for a +CME ERROR. Errors with other causes give BUSY: the driver then asks again."""
    return _SIM_ERRORS.get(code, Sim.BUSY) if code is not None else _SIM_TEXTS.get(detail.lower(), Sim.BUSY)


_ICCID = re.compile(r"(?:\+C?ICCID: ?)?\"?(89\d{16,18}F?)\"?$")


def iccid(line: str) -> str:
    """Return the ICCID of AT+CICCID, as printed on the card: 89 and 16 to 18 more digits (ITU-T E.118).

    Raises ProtocolError for any other line.
    """
    if match := _ICCID.match(line):
        return match[1]
    raise ProtocolError("AT+CICCID was answered without an ICCID")


class Attempts(NamedTuple):
    """Remaining attempts to enter PIN and PUK, from AT+SPIC."""

    pin: int
    puk: int


def attempts(line: str) -> Attempts:
    """Parse `+SPIC: <PIN>,<PUK>,<PIN2>,<PUK2>`. Raises ProtocolError for fewer than two columns."""
    columns = fields(line, "+SPIC")
    if len(columns) < 2:
        raise ProtocolError(f"{line[:60]!r}: {len(columns)} columns; at least 2 are needed")
    return Attempts(number(columns[0], line), number(columns[1], line))


def flag(line: str, prefix: str) -> int:
    """Return the last number of a line such as `+CGATT: 1`, `+CFUN: 1`, `+CNMP: 2` or `+CGACT: 1,1`."""
    return number(fields(line, prefix)[-1], line)


def is_active(line: str, context: int) -> bool:
    """Return True if the line `+CGACT: <cid>,<state>` (clause 10.1.10) reports the packet context as active."""
    columns = [number(text, line) for text in fields(line, "+CGACT")]
    return columns == [context, 1]


_USB_ID = re.compile(r"(?:\+CUSBCFG: ?)?USBID: ?0X([0-9A-F]{4}),0X([0-9A-F]{4})$", re.IGNORECASE)


def usb_id(lines: Iterable[str]) -> tuple[int, int]:
    """Return vendor and product of AT+CUSBCFG?, in a line without prefix: `USBID: 0X1E0E,0X9001`.

    Raises ProtocolError if no line matches.
    """
    for line in lines:
        if match := _USB_ID.match(line):
            return int(match[1], 16), int(match[2], 16)
    raise ProtocolError("AT+CUSBCFG? was answered without a USBID")
