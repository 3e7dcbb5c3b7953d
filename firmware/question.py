"""One question of the control socket: what is asked, and its one answer, which comes at once, later or not in time."""

import json
from collections.abc import Callable, Mapping

from board.describe import remedy
from board.errors import RequestError, StationError
from board.loop import Loop, Timer
from drivers.contract import Answer

ANSWER_S = 10.0  # unless the question says `within_s`, or its command has another
LONGEST_S = 600.0  # a modem's list of networks takes up to 300 s

Question = dict[str, object]
Command = Callable[[Question], dict[str, object]]
Later = Callable[[Question, Answer], None]


class Commands:
    """What may be asked.

    now    name in "do" -> what makes the answer; a StationError of it is the answer's error.
    later  name in "do" -> what answers when it can, by the call that it is given; that may come at once.
    within_s  name in "do" -> seconds for its answer, where the question does not say; others have ANSWER_S.
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
        """Answer one line, at once or later."""
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
    """An answer that is waited for; said() is given it, once, as the object that goes out."""

    def __init__(self, loop: Loop, said: Callable[[dict[str, object]], None]) -> None:
        self._loop = loop
        self._said: Callable[[dict[str, object]], None] | None = said
        self._deadline: Timer | None = None

    def wait(self, within_s: float, do: str) -> None:
        late = RequestError(f"{do}: no answer within {within_s:g} s", "it may still be done; ask for the status")
        self._deadline = self._loop.after(within_s, lambda: self.answer(late))

    def answer(self, answer: Mapping[str, object] | StationError) -> None:
        """The first answer is the one; what comes after it, or after forget(), is nobody's."""
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
    """The text of a key, one of the known words where there are such. Raises RequestError."""
    value = question.get(key)
    if not isinstance(value, str) or (known is not None and value not in known):
        what = "is missing" if value is None else f"{value!r} is not known"
        raise RequestError(f"{key}: {what}", remedy(value or "", known) if known is not None else "give a text")
    return value


def _within(question: Question, usual_s: float) -> float:
    value = question.get("within_s", usual_s)
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 < value <= LONGEST_S:
        raise RequestError(f"within_s: {value!r} is no number of seconds above 0, at most {LONGEST_S:g}")
    return float(value)
