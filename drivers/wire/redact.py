"""What must stand in no journal: who owns the SIM and the modem, and its secrets."""

import re

# Of IMEI and IMSI 15 digits, of an ICCID 18 to 20, whatever stands around them. The longest number that identifies no
# person is that of an NR cell with its PLMN in front: 17 digits, therefore hidden as well; a cell alone has 11.
_LONG = re.compile(r"\+?\d{12,}F?")

# A short message in hexadecimal, with numbers of telephones in it; a cell has at most 10 of these digits.
_HEXADECIMAL = re.compile(r"[0-9A-Fa-f]{16,}")

# Of what is garbled a few digits are a part of something. A port's own numbers have up to 5.
_SOME = re.compile(r"\d{6,}")

# A telephone number has 3 to 15 digits, so what speaks of one is known by its name.
_CALLER = re.compile(r"((?:\+CLIP|\+CNUM|\+CMT|\+CDS|\+CMG[LR]|\+CCWA|\+CUSD|\+COLP|MISSED_CALL|\+CSCA)\b[: ]).*")
_INTERNATIONAL = re.compile(r'"\+\d{3,}"')
_DIAL = re.compile(r"\b(ATD)[^;]*", re.IGNORECASE)

# Secrets of our own commands, whose echo may have lost its beginning, and what the card and the maker call themselves.
_SECRET = re.compile(r"((?:PIN|CLCK|CPWD|CGAUTH|CNUM|EGMR|SIMEI)=).+", re.IGNORECASE)
_LABELLED = re.compile(r"\b((?:IMEI|IMEISV|IMSI|ICCID|MEID|S/?N|SERIAL)\s*[:=]\s*)\S+", re.IGNORECASE)


def redact(text: str) -> str:
    """A line of an AT port as it may be logged: identifiers and secrets are replaced by what they are."""
    text = _SECRET.sub(r"\1<secret>", text)
    text = _DIAL.sub(r"\1<number>", text)
    text = _CALLER.sub(r"\1<personal>", text)
    text = _LABELLED.sub(r"\1<personal>", text)
    text = _INTERNATIONAL.sub('"<number>"', text)
    return _hide(_LONG, _hide(_HEXADECIMAL, text))


def redact_garbage(octets: bytes) -> str:
    """Octets that are no line of a port, or parts of some: the same, and no number of more than 5 digits."""
    return _hide(_SOME, redact(octets.decode("ascii", "backslashreplace")))


def _hide(pattern: re.Pattern[str], text: str) -> str:
    return pattern.sub(lambda match: f"<{len(match[0])} digits>", text)
