"""Operator's commands to a modem: `captain modem status`, `at` and `reset`.

| ask | arguments | answer |
|---|---|---|
| `status` | | details of the modem, as in status |
| `at` | `command`, `force` (false) | `{"command", "result", "lines"}`: the complete answer, nothing is hidden |
| `reset` | | `{"reset": "begun"}`; status shows the progress |

Without force only commands that change nothing are sent. Others can lock the card, disconnect the module from the
network permanently, or cost money.
"""

import re
from collections.abc import Callable, Mapping

from board.runtime.errors import RequestError, StationError
from drivers.contract import Answer
from drivers.sim8202g.known import Known
from drivers.sim8202g.port import AtPort
from drivers.wire.at import port as at
from drivers.wire.at.forms import TIMEOUT, command

PRIORITY = 2  # lower than that of the driver's own commands; the port sends one command at a time

# Commands that end with ? only ask, except AT+COPS=?, which ends data connections. _HARMLESS has commands that only
# ask although they do not end with ?.
_QUESTION = re.compile(r"AT[+$^*][A-Z0-9]+\??|AT[+$^*](?!COPS)[A-Z0-9]+=\?", re.IGNORECASE)
_HARMLESS = re.compile(
    r"AT(?:|I[0-9]?|&V|\+(?:CSQ|CESQ|CGMI|CGMM|CGMR|CGSN|CIMI|CICCID|SPIC|CPMUTEMP|CBC|CGPSINFO|CNUM|CLAC|SIMCOMATI|"
    r"CGPADDR(?:=\d+)?|CGCONTRDP(?:=\d+)?))",
    re.IGNORECASE,
)


def is_harmless(text: str) -> bool:
    """Return True if an AT command changes nothing."""
    is_question = text.endswith("?") and _QUESTION.fullmatch(text) is not None
    return is_question or _HARMLESS.fullmatch(text) is not None


class Operations:
    """Operator's commands to one modem.

    port   AT port; None while the modem has none.
    reset  function that starts a reset.
    """

    def __init__(self, port: AtPort | None, known: Known, reset: Callable[[], None]) -> None:
        self._port = port
        self._known = known
        self._reset = reset

    def operate(self, do: str, arguments: Mapping[str, object], answer: Answer) -> None:
        """Execute a command and call answer() once, immediately or later; with a StationError if it fails."""
        try:
            if do == "status":
                answer(self._known.details())
            elif do == "at":
                self._at(arguments, answer)
            elif do == "reset":
                self._open_port()
                answer({"reset": "begun"})
                self._reset()
            else:
                raise RequestError(f"unknown command of a modem: {do!r}", "one of at, reset, status")
        except StationError as error:
            answer(error)

    def _at(self, arguments: Mapping[str, object], answer: Answer) -> None:
        text, force = arguments.get("command"), arguments.get("force", False)
        if not isinstance(text, str) or not isinstance(force, bool):
            raise RequestError(
                "at needs a text as command, and true or false as force", 'such as {"command": "AT+CSQ"}'
            )
        text = text.strip()
        asked = command(text)
        if not force and not is_harmless(text):
            raise RequestError(f"{text[:40]!r} may change the modem", "add --force to send it; queries need no --force")
        self._open_port().ask(asked, lambda found: answer(_result(found)), PRIORITY)

    def _open_port(self) -> AtPort:
        if self._port is None:
            raise RequestError("the modem has no port now", "the modem is absent or restarting; see captain status")
        return self._port


def _result(found: at.Answer) -> Mapping[str, object] | StationError:
    if found.final is TIMEOUT:
        return RequestError(
            f"no answer within {found.command.timeout_s:.0f} s", "the modem may be busy, or not support the command"
        )
    return {"command": found.command.text, "result": str(found.final), "lines": list(found.lines)}
