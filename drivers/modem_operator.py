"""What an operator may ask of a modem: `captain modem status`, `at` and `reset`.

| ask | arguments | answer |
|---|---|---|
| `status` | | what status shows of the modem |
| `at` | `command`, `force` (false) | `{"command", "result", "lines"}`: the answer as it came, nothing is hidden |
| `reset` | | `{"reset": "begun"}`; the status tells how it goes on |

Only what asks and changes nothing is sent without force: a command from a manual page can lock the card, take the
module off the network for good, or cost money.
"""

import re
from collections.abc import Callable, Mapping

from board.errors import RequestError, StationError
from drivers.contract import Answer
from drivers.modem_known import Known
from drivers.modem_port import AtPort
from drivers.wire import at
from drivers.wire.at_forms import TIMEOUT, command

PRIORITY = 2  # after what the driver wants to know: it asks one thing at a time

# Questions end with ? (AT+COPS=? is one that ends data connections), and these have no such end.
_QUESTION = re.compile(r"AT[+$^*][A-Z0-9]+\??|AT[+$^*](?!COPS)[A-Z0-9]+=\?", re.IGNORECASE)
_HARMLESS = re.compile(
    r"AT(?:|I[0-9]?|&V|\+(?:CSQ|CESQ|CGMI|CGMM|CGMR|CGSN|CIMI|CICCID|SPIC|CPMUTEMP|CBC|CGPSINFO|CNUM|CLAC|SIMCOMATI|"
    r"CGPADDR(?:=\d+)?|CGCONTRDP(?:=\d+)?))",
    re.IGNORECASE,
)


def is_harmless(text: str) -> bool:
    """Whether a command changes nothing."""
    is_question = text.endswith("?") and _QUESTION.fullmatch(text) is not None
    return is_question or _HARMLESS.fullmatch(text) is not None


class Operations:
    """One question of an operator; port is None while the modem has none."""

    def __init__(self, port: AtPort | None, known: Known, reset: Callable[[], None]) -> None:
        self._port = port
        self._known = known
        self._reset = reset

    def operate(self, do: str, arguments: Mapping[str, object], answer: Answer) -> None:
        """Answer once, at once or later: with a StationError for what cannot be done."""
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
                raise RequestError(f"a modem does not know {do!r}", "one of at, reset, status")
        except StationError as error:
            answer(error)

    def _at(self, arguments: Mapping[str, object], answer: Answer) -> None:
        text, force = arguments.get("command"), arguments.get("force", False)
        if not isinstance(text, str) or not isinstance(force, bool):
            raise RequestError("at takes a command, and force as true or false", 'such as {"command": "AT+CSQ"}')
        text = text.strip()
        asked = command(text)
        if not force and not is_harmless(text):
            raise RequestError(
                f"{text[:40]!r} may change the modem", "questions are sent as they are; with --force all"
            )
        self._open_port().ask(asked, lambda found: answer(_result(found)), PRIORITY)

    def _open_port(self) -> AtPort:
        if self._port is None:
            raise RequestError("the modem has no port now", "it is absent or restarting; captain status says which")
        return self._port


def _result(found: at.Answer) -> Mapping[str, object] | StationError:
    if found.final is TIMEOUT:
        return RequestError(
            f"no answer within {found.command.timeout_s:.0f} s", "it may be busy, or not know the command"
        )
    return {"command": found.command.text, "result": str(found.final), "lines": list(found.lines)}
