"""Redaction of logs: identities of SIM and modem, and secrets."""

import re

# An IMEI or IMSI has 15 digits, an ICCID 18 to 20, with any text around them. This also hides an NR cell identity
# after its PLMN, which has 17 digits and identifies no person. An NR cell identity alone has 11 digits: it is shown.
_LONG = re.compile(r"\+?\d{12,}F?")

# A short message (SMS) in hexadecimal contains telephone numbers. A cell identity has at most 10 of these digits.
_HEXADECIMAL = re.compile(r"[0-9A-Fa-f]{16,}")

# In garbled text, a few digits may be part of an identifier. Numbers of the port itself have up to 5 digits.
_SOME = re.compile(r"\d{6,}")

# A telephone number has 3 to 15 digits, too few for _LONG. The code at the start of the line reveals it.
_CALLER = re.compile(r"((?:\+CLIP|\+CNUM|\+CMT|\+CDS|\+CMG[LR]|\+CCWA|\+CUSD|\+COLP|MISSED_CALL|\+CSCA)\b[: ]).*")
_INTERNATIONAL = re.compile(r'"\+\d{3,}"')
_DIAL = re.compile(r"\b(ATD)[^;]*", re.IGNORECASE)

# Secrets in our own commands, whose echo may lack its first characters; and identifiers after a label.
_SECRET = re.compile(r"((?:PIN|CLCK|CPWD|CGAUTH|CNUM|EGMR|SIMEI)=).+", re.IGNORECASE)
_LABELLED = re.compile(r"\b((?:IMEI|IMEISV|IMSI|ICCID|MEID|S/?N|SERIAL)\s*[:=]\s*)\S+", re.IGNORECASE)


def redact(text: str) -> str:
    """Return a line of an AT port for the log: placeholders such as <secret> replace identifiers and secrets."""
    text = _SECRET.sub(r"\1<secret>", text)
    text = _DIAL.sub(r"\1<number>", text)
    text = _CALLER.sub(r"\1<personal>", text)
    text = _LABELLED.sub(r"\1<personal>", text)
    text = _INTERNATIONAL.sub('"<number>"', text)
    return _hide(_LONG, _hide(_HEXADECIMAL, text))


def redact_garbage(octets: bytes) -> str:
    """Return unparsed octets of an AT port for the log: redacted, and without numbers of more than 5 digits."""
    return _hide(_SOME, redact(octets.decode("ascii", "backslashreplace")))


def _hide(pattern: re.Pattern[str], text: str) -> str:
    return pattern.sub(lambda match: f"<{len(match[0])} digits>", text)
