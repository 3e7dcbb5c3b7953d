"""Question of the control socket: one command, answered within a time limit."""

import json
from collections.abc import Callable, Mapping

from board.runtime.describe import remedy
from board.runtime.errors import RequestError, StationError
from board.runtime.loop import Loop, Timer
from drivers.contract import Answer

ANSWER_S = 10.0  # time limit of a command, if neither `within_s` of the question nor the command sets another one
LONGEST_S = 600.0  # upper bound of `within_s`: a modem needs up to 300 s to list networks

Question = dict[str, object]
Command = Callable[[Question], dict[str, object]]
Later = Callable[[Question, Answer], None]


class Commands:
    """Commands of the control socket, by the name in "do" of the question.

    now       functions that return the answer. A StationError that they raise becomes the error of the answer.
    later     functions that call back with the answer, at once or later.
    within_s  default time limits in seconds of commands in `later`; the others have ANSWER_S.
    """

    def __init__(
        self,
        now: Mapping[str, Command],
        later: Mapping[str, Later] | None = None,
        within_s: Mapping[str, float] | None = None,
    ) -> None:
        self.now = now
        self.later = later or {}
        self.within_s = within_s or {}

    def ask(self, line: bytes, pending: "Pending") -> None:
        """Execute one line; `pending` receives the answer, at once or later."""
        try:
            question = json.loads(line)
        except (ValueError, RecursionError):
            pending.answer(RequestError("not JSON", 'one object a line, such as {"do": "status"}'))
            return
        word = question.get("do") if isinstance(question, dict) else None
        do = word if isinstance(word, str) else ""
        try:
            if do in self.now:
                pending.answer(self.now[do](question))
            elif do in self.later:
                pending.wait(_within(question, self.within_s.get(do, ANSWER_S)), do)
                self.later[do](question, pending.answer)
            else:
                known = ", ".join(sorted([*self.now, *self.later]))
                pending.answer(RequestError(f"unknown command {word!r}", f"one of {known}"))
        except StationError as error:
            pending.answer(error)


class Pending:
    """Pending answer of a command: calls said() once, with the JSON object to send."""

    def __init__(self, loop: Loop, said: Callable[[dict[str, object]], None]) -> None:
        self._loop = loop
        self._said: Callable[[dict[str, object]], None] | None = said
        self._deadline: Timer | None = None

    def wait(self, within_s: float, do: str) -> None:
        late = RequestError(f"{do}: no answer within {within_s:g} s", "it may still complete; ask for the status")
        self._deadline = self._loop.after(within_s, lambda: self.answer(late))

    def answer(self, answer: Mapping[str, object] | StationError) -> None:
        """Send the first answer. Further answers, and those after forget(), are ignored."""
        said = self._said
        if said is None:
            return
        self.forget()
        if isinstance(answer, StationError):
            said({"ok": False, "error": answer.message, "hint": answer.hint})
        else:
            said({"ok": True, **answer})

    def forget(self) -> None:
        self._said = None
        if self._deadline is not None:
            self._deadline.cancel()


def text(question: Question, key: str, known: Mapping[str, object] | None = None) -> str:
    """Return the text of a key of a question.

    known  permitted values, as keys; None permits any text.

    Raises RequestError if the value is missing, is not text or is not permitted.
    """
    value = question.get(key)
    if not isinstance(value, str) or (known is not None and value not in known):
        what = "is missing" if value is None else f"{value!r} is not known"
        raise RequestError(f"{key}: {what}", remedy(value or "", known) if known is not None else "give a text")
    return value


def _within(question: Question, usual_s: float) -> float:
    value = question.get("within_s", usual_s)
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 < value <= LONGEST_S:
        raise RequestError(f"within_s: {value!r}: out of range; above 0, at most {LONGEST_S:,.0f} seconds")
    return float(value)
