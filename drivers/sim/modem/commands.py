"""Answers of a simulated SIM8202G to AT commands, by the AT command manual of the SIM82xx."""

import re
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

from drivers.sim.modem.network import ADDRESS, AIRS, OPERATOR, Access

if TYPE_CHECKING:
    from drivers.sim.modem.modem import SimulatedModem

ERROR = "ERROR"

# Invented numbers; no real card or device has them.
IMEI, IMSI, ICCID = "867584030000000", "262010000000000", "89490200000000000000"


class Reply(NamedTuple):
    """Answer to a command: lines and a final code, sent after delay_s."""

    lines: tuple[str, ...] = ()
    final: str = "OK"
    delay_s: float = 0.02


Handler = Callable[["SimulatedModem", re.Match[str]], Reply]


def _says(*lines: str) -> Handler:
    return lambda modem, match: Reply(lines)


def _registration(modem: "SimulatedModem", match: re.Match[str]) -> Reply:
    status = modem.network.status(match[1])
    place = ',"5A1E","0B28A00C",7' if status == 1 else ""
    return Reply((f"+{match[1]}: 2,{status}{place}",))


def _sim(modem: "SimulatedModem", match: re.Match[str]) -> Reply:
    card = modem.card
    if not card.is_there:
        return Reply((), "+CME ERROR: 10")
    if modem.is_busy:
        return Reply((), "+CME ERROR: 14")
    return Reply((f"+CPIN: {card.state}",))


def _pin(modem: "SimulatedModem", match: re.Match[str]) -> Reply:
    card = modem.card
    if not card.is_there or card.state != "SIM PIN":
        return Reply((), "+CME ERROR: 3")
    card.tries.append(match[1])
    if match[1] != card.pin:
        card.attempts -= 1
        card.state = "SIM PIN" if card.attempts else "SIM PUK"
        return Reply((), "+CME ERROR: 16" if card.attempts else "+CME ERROR: 12")
    card.attempts, card.state = 3, "READY"
    modem.loop.after(1.0, modem.network.search)
    return Reply()


def _radio(modem: "SimulatedModem", match: re.Match[str]) -> Reply:
    modem.functionality = int(match[1])
    if match[2]:
        modem.restart()
    elif modem.functionality != 1:
        modem.network.leave()
    elif modem.card.is_ready:
        modem.network.search()
    return Reply((), delay_s=0.5)


def _select(modem: "SimulatedModem", match: re.Match[str]) -> Reply:
    modem.network.search()
    return Reply((), delay_s=4.0)


def _attach(modem: "SimulatedModem", match: re.Match[str]) -> Reply:
    network = modem.network
    if match[1] == "0":
        network.attached = network.is_context_up = False
    elif not network.is_registered:
        return Reply((), "+CME ERROR: 30")
    else:
        network.attached = True
    return Reply((), delay_s=1.0)


def _context(modem: "SimulatedModem", match: re.Match[str]) -> Reply:
    network = modem.network
    if not network.attached:
        return Reply((), "+CME ERROR: 148")
    network.is_context_up = match[1] == "1"
    return Reply((), delay_s=0.5)


def _call(modem: "SimulatedModem", match: re.Match[str]) -> Reply:
    if match[1] == "0":
        modem.network.is_context_up = False
        return Reply()
    if not modem.network.attached:
        return Reply((), "NO CARRIER", 2.0)
    modem.network.is_context_up = True
    return Reply(("$QCRMCALL: 1, V4",), delay_s=1.0)


def _addresses(modem: "SimulatedModem", match: re.Match[str]) -> Reply:
    return Reply((f'+CGPADDR: 1,"{ADDRESS if modem.network.is_context_up else "0.0.0.0"}"',))


def _composition(modem: "SimulatedModem", match: re.Match[str]) -> Reply:
    modem.product = match[1].lower()
    modem.restart()
    return Reply()


def _restart(modem: "SimulatedModem", match: re.Match[str]) -> Reply:
    modem.restart()
    return Reply()


def _set_mode(modem: "SimulatedModem", match: re.Match[str]) -> Reply:
    modem.mode = int(match[1])
    return Reply((), delay_s=1.0)


def _set_context(modem: "SimulatedModem", match: re.Match[str]) -> Reply:
    modem.context = (match[1], match[2])
    return Reply()


def _operator(modem: "SimulatedModem", match: re.Match[str]) -> Reply:
    if not modem.network.is_registered:
        return Reply(("+COPS: 0",))
    return Reply((f'+COPS: 0,0,"{OPERATOR}",{AIRS[modem.network.camped].operator}',))


def _cell(modem: "SimulatedModem", match: re.Match[str]) -> Reply:
    if modem.functionality != 1:
        return Reply(("+CPSI: NO SERVICE,Low Power Mode",))
    return Reply(AIRS[modem.network.camped].cell)


def _signal(modem: "SimulatedModem", match: re.Match[str]) -> Reply:
    return Reply((f"+CSQ: {AIRS[modem.network.camped].signal}",))


def _echo(modem: "SimulatedModem", match: re.Match[str]) -> Reply:
    modem.echo = match[1] == "1"
    return Reply()


HANDLERS: list[tuple[re.Pattern[str], Handler]] = [
    (re.compile(pattern), handler)
    for pattern, handler in (
        (r"AT", _says()),
        (r"ATE([01])(?:V1)?", _echo),
        (r"AT\+CMEE=\d", _says()),
        (r"ATI", _says("Manufacturer: SIMCOM INCORPORATED", "Model: SIMCOM_SIM8202G-M2", f"IMEI: {IMEI}")),
        (r"AT\+CGMM", _says("SIMCOM_SIM8202G-M2")),
        (r"AT\+CGMR", _says("+CGMR: LE13B04SIM8202M44A-M2")),
        (r"AT\+CGSN", _says(IMEI)),
        (r"AT\+CIMI", _says(IMSI)),
        (r"AT\+CICCID", _says(f"+ICCID: {ICCID}")),
        (r"AT\+CUSBCFG\?", lambda modem, match: Reply(("USBADB: 0", f"USBID: 0X1E0E,0X{modem.product.upper()}"))),
        (r"AT\+CUSBCFG=usbid,1e0e,([0-9a-fA-F]{4})", _composition),
        (r"AT\+CPIN\?", _sim),
        (r'AT\+CPIN="(\d+)"', _pin),
        (r"AT\+SPIC", lambda modem, match: Reply((f"+SPIC: {modem.card.attempts},10,0,10",))),
        (r"AT\+CFUN\?", lambda modem, match: Reply((f"+CFUN: {modem.functionality}",))),
        (r"AT\+CFUN=([0-9])(,1)?", _radio),
        (r"AT\+CNMP\?", lambda modem, match: Reply((f"+CNMP: {modem.mode}",))),
        (r"AT\+CNMP=(\d+)", _set_mode),
        (r"AT\+CGDCONT\?", lambda modem, match: Reply(('+CGDCONT: 1,"{}","{}","0.0.0.0",0,0'.format(*modem.context),))),
        (r'AT\+CGDCONT=1,"(\w+)","([^"]*)"', _set_context),
        (r"AT\+(?:CREG|CGREG|CEREG|C5GREG|CNSMOD)=\d", _says()),
        (r"AT\+CGEREP=[\d,]+", _says()),
        (r"AT\+(CREG|CGREG|CEREG|C5GREG)\?", _registration),
        (r"AT\+CNSMOD\?", lambda modem, match: Reply((f"+CNSMOD: 1,{8 if modem.network.is_registered else 0}",))),
        (r"AT\+COPS\?", _operator),
        (r"AT\+COPS=0", _select),
        (r"AT\+CPSI\?", _cell),
        (r"AT\+CSQ", _signal),
        (r"AT\+CPMUTEMP", lambda modem, match: Reply((f"+CPMUTEMP: {modem.celsius}",))),
        (r"AT\+CBC", _says("+CBC: 0.039V")),
        (r"AT\+CGATT\?", lambda modem, match: Reply((f"+CGATT: {modem.network.attached:d}",))),
        (r"AT\+CGATT=([01])", _attach),
        (r"AT\+CGACT\?", lambda modem, match: Reply((f"+CGACT: 1,{modem.network.is_context_up:d}", "+CGACT: 2,0"))),
        (r"AT\+CGACT=([01]),1", _context),
        (r"AT\+CGPADDR=1", _addresses),
        (r"AT\$QCRMCALL=([01]),1", _call),
        (r"AT\+CRESET", _restart),
        (r"AT\+CPOF", _restart),  # with the supply on, the modem starts again by itself
    )
]


def reply(modem: "SimulatedModem", text: str) -> Reply:
    """Return the answer to a command line."""
    for pattern, handler in HANDLERS:
        if match := pattern.fullmatch(text):
            return handler(modem, match)
    return Reply((), ERROR)


__all__ = ["ADDRESS", "ICCID", "IMEI", "IMSI", "Access", "Reply", "reply"]
