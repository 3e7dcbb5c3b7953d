"""What must stand in no journal: who owns the SIM and the modem, and its secrets."""

import re

# Of IMEI and IMSI 15 digits, of an ICCID 18 to 20. The longest number that identifies no person is that of an NR
# cell with its PLMN in front: 17 digits, which is therefore hidden as well; a cell alone has 11.
_LONG = re.compile(r"(?<![0-9A-Fa-f.])\+?\d{12,22}F?(?![0-9A-Fa-f])")

# A short message in hexadecimal, with numbers of telephones in it; a cell has at most 10 of these digits.
_HEXADECIMAL = re.compile(r"\b[0-9A-Fa-f]{16,}\b")

# A telephone number has 3 to 15 digits, so what speaks of one is known by its name.
_CALLER = re.compile(r"((?:\+CLIP|\+CNUM|\+CMT|\+CDS|\+CMG[LR]|\+CCWA|\+CUSD|\+COLP|MISSED_CALL|\+CSCA)\b[: ]).*")
_INTERNATIONAL = re.compile(r'"\+\d{3,}"')
_DIAL = re.compile(r"^(ATD)[^;]*", re.IGNORECASE)

# Secrets of our own commands, and what the card and the maker call themselves.
_SECRET = re.compile(r"^(AT\+(?:CPIN|CLCK|CPWD|CGAUTH|CNUM|EGMR|SIMEI)=).+", re.IGNORECASE)
_LABELLED = re.compile(r"\b((?:IMEI|IMEISV|IMSI|ICCID|MEID|S/?N|SERIAL)\s*[:=]\s*)\S+", re.IGNORECASE)


def redact(text: str) -> str:
    """A line of an AT port as it may be logged: identifiers and secrets are replaced by what they are."""
    text = _SECRET.sub(r"\1<secret>", text)
    text = _DIAL.sub(r"\1<number>", text)
    text = _CALLER.sub(r"\1<personal>", text)
    text = _LABELLED.sub(r"\1<personal>", text)
    text = _INTERNATIONAL.sub('"<number>"', text)
    for pattern in (_LONG, _HEXADECIMAL):
        text = pattern.sub(lambda match: f"<{len(match[0])} digits>", text)
    return text
