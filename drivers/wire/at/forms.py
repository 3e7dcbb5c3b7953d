"""Lines of an AT port: final codes, unsolicited codes, and the form of answers.

Answers and unsolicited codes begin with the same prefix. The pending command and the form distinguish them:
`+CREG: 1` and `+CREG: 1,"5A1E","0B28A00C",7` are unsolicited, `+CREG: 0,1` answers AT+CREG?. If both have the same
form (`+CSQ: 20,99`), the last line before the final code is the answer.

Sources: ITU-T V.250 clause 5.7; 3GPP TS 27.007 clauses 7 to 10; SIMCom AT command manual of the SIM82xx, V1.02.
"""

import re
from typing import NamedTuple

from board.runtime.errors import RequestError

MAX_COMMAND = 512  # octets; V.250 requires a modem to accept 40, SIMCom's accept 1500
MAX_LINES = 256  # per answer; AT+CLAC lists about 200 commands


class Command(NamedTuple):
    """Command line and the expected form of its answer.

    text       command without the final CR.
    timeout_s  longest time until its final code.
    expects    form of each line of its answer; None: every line except unsolicited codes.
    most       largest number of lines in its answer.
    """

    text: str
    timeout_s: float = 5.0
    expects: re.Pattern[str] | None = None
    most: int = MAX_LINES

    @property
    def is_call(self) -> bool:
        """True if the command is a call: then NO CARRIER, BUSY and the like are its final codes."""
        return bool(_CALLS.match(self.text))

    @property
    def is_query(self) -> bool:
        """True if the answer must have a line besides OK."""
        return self.expects not in (None, _NEVER)

    def takes(self, line: str) -> bool:
        """Return True if a line belongs to the answer."""
        return not UNSOLICITED.match(line) if self.expects is None else bool(self.expects.match(line))


class Form(NamedTuple):
    """Row of the table of commands: expected form, largest number of lines and timeout of an answer."""

    expects: re.Pattern[str]
    most: int = 1
    timeout_s: float = 5.0


_NAME = re.compile(r"AT([+$^*&#]?[A-Z0-9]+?)(=\?|\?|=|$)", re.IGNORECASE)
_CALLS = re.compile(r"AT(D|A$|O|\$QCRMCALL=|\+CGDATA)", re.IGNORECASE)
_NEVER = re.compile(r"(?!)")


def _prefix(name: str, rest: str = "") -> re.Pattern[str]:
    return re.compile(re.escape(name) + ": ?" + rest)


# An answer begins with the two numbers <n>,<stat>. An unsolicited code begins with <stat>; then follows an area code
# in quotes or with more hexadecimal digits.
_REGISTRATION = r"\d,\d{1,2}(?:,|$)"

FORMS: dict[str, Form] = {
    **{f"+{name}?": Form(_prefix(f"+{name}", _REGISTRATION), timeout_s=10.0)
       for name in ("CREG", "CGREG", "CEREG", "C5GREG")},
    **{f"+{name}=": Form(_NEVER) for name in ("CREG", "CGREG", "CEREG", "C5GREG", "CNSMOD", "CMEE")},
    "+CSQ": Form(_prefix("+CSQ", r"\d+,\d+$")),
    # NOT READY and NOT INSERTED are unsolicited. The answer for a missing SIM is a +CME ERROR.
    "+CPIN?": Form(_prefix("+CPIN", "(?!NOT )"), timeout_s=10.0),
    "+CPIN=": Form(_NEVER, timeout_s=20.0),
    "+CICCID": Form(re.compile(r"(?:\+C?ICCID: ?)?\"?\d{18}"), timeout_s=10.0),
    "+SPIC": Form(_prefix("+SPIC", r"\d")),
    "+CPSI?": Form(_prefix("+CPSI"), most=8, timeout_s=9.0),
    "+COPS?": Form(_prefix("+COPS", r"\d"), timeout_s=10.0),
    "+COPS=": Form(_NEVER, timeout_s=120.0),
    "+COPS=?": Form(_prefix("+COPS", r"\("), timeout_s=300.0),
    "+CNSMOD?": Form(_prefix("+CNSMOD", r"\d+,\d+$")),
    "+CNMP?": Form(_prefix("+CNMP", r"\d+$")),
    "+CNMP=": Form(_NEVER, timeout_s=10.0),
    "+CPMUTEMP": Form(_prefix("+CPMUTEMP", r"-?\d+$")),
    "+CGDCONT?": Form(_prefix("+CGDCONT"), most=24),
    "+CGATT?": Form(_prefix("+CGATT", r"\d$"), timeout_s=10.0),
    "+CGATT=": Form(_NEVER, timeout_s=140.0),
    "+CGACT?": Form(_prefix("+CGACT", r"\d+,\d$"), most=24),
    "+CGACT=": Form(_NEVER, timeout_s=180.0),
    "+CGPADDR=": Form(_prefix("+CGPADDR")),
    # The lines of this answer have no prefix: USBADB: 0, USBID: 0X1E0E,0X9001.
    "+CUSBCFG?": Form(re.compile(r"USB\w+:|\+CUSBCFG:"), most=16),
    "+CUSBCFG=": Form(_NEVER),
    "+CFUN?": Form(_prefix("+CFUN", r"\d+$"), timeout_s=10.0),
    "+CFUN=": Form(_NEVER, timeout_s=10.0),
    "+CRESET": Form(_NEVER, timeout_s=10.0),
    "+CPOF": Form(_NEVER, timeout_s=10.0),
    "$QCRMCALL=": Form(_prefix("$QCRMCALL"), most=4, timeout_s=30.0),
    "$QCRMCALL?": Form(_prefix("$QCRMCALL"), most=4),
}  # fmt: skip

# Unsolicited codes of SIMCom modems that cannot be confused with an answer.
UNSOLICITED = re.compile(
    r"""
    (?:RDY|SMS\ DONE|PB\ DONE|RING|NETDIS|NO\ CARRIER|BUSY|NO\ ANSWER|NO\ DIALTONE)$
    | \+CPIN:\ ?(?:READY|NOT\ READY|NOT\ INSERTED)$
    | \+C(?:G|E|5G)?REG:\ ?\d{1,2}(?:$|,(?:"|[0-9A-Fa-f]{3,8},))
    | \+CNSMOD:\ ?\d+$
    | \+(?:SIMCARD|CGEV|CTZV|CTZE|NITZ|CMTI|CLIP|CRING|RXDTMF|CUSD|CMT|CDS|CDSI):
    | VOICE\ CALL: | MISSED_CALL:
    """,
    re.VERBOSE,
)

# Form of a code; used for unsolicited codes that are not listed above.
CODE = re.compile(r"[+^$*#%][A-Z][A-Z0-9_]*(?::|$)")


class Final(NamedTuple):
    """Final code: OK, CONNECT, ERROR, NO CARRIER, ..., or one of the core's own: TIMEOUT, SILENT, GONE.

    code    number of +CME ERROR (27.007 clause 9.2) or +CMS ERROR; None without one.
    detail  text of these errors in place of a number, or the speed after CONNECT.
    """

    name: str
    code: int | None = None
    detail: str = ""

    @property
    def is_ok(self) -> bool:
        return self.name in ("OK", "CONNECT")

    def __str__(self) -> str:
        return f"{self.name}: {self.detail or self.code}" if self.detail or self.code is not None else self.name


TIMEOUT = Final("no answer")  # within the timeout of the command
SILENT = Final("the modem is silent")  # even AT gets no answer, so the command was not sent
GONE = Final("the port is gone")

_FINALS = {"OK", "ERROR", "MODEM ERROR", "COMMAND NOT SUPPORT"}
_CALL_FINALS = {"NO CARRIER", "BUSY", "NO ANSWER", "NO DIALTONE"}
_EXTENDED = re.compile(r"\+(CME|CMS) ERROR: ?(.*)$")
_CONNECT = re.compile(r"CONNECT(?: (.*))?$")


def final(line: str, is_call: bool) -> Final | None:
    """Return the final code in a line, or None. is_call: codes such as NO CARRIER and CONNECT are final too."""
    if line in _FINALS or (is_call and line in _CALL_FINALS):
        return Final("OK" if line == "OK" else line)
    if extended := _EXTENDED.match(line):
        name, what = f"+{extended[1]} ERROR", extended[2].strip()
        return Final(name, int(what)) if what.isdecimal() and len(what) < 6 else Final(name, None, what)
    if is_call and (connect := _CONNECT.match(line)):
        return Final("CONNECT", None, connect[1] or "")
    return None


def command(text: str) -> Command:
    """Return a command with the known form of its answer. Raises RequestError for an invalid command line."""
    if not text.isascii() or not text.isprintable() or not text[:2].upper() == "AT" or len(text) > MAX_COMMAND:
        raise RequestError(
            f"invalid AT command: {text[:40]!r}: AT and printable ASCII, at most {MAX_COMMAND} characters",
            'such as "AT+CSQ"',
        )
    name = _NAME.match(text)
    form = FORMS.get(name[1].upper() + name[2]) if name and ";" not in text else None
    if form is None:
        return Command(text)
    return Command(text, form.timeout_s, form.expects, form.most)
