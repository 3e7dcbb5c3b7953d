"""Waiting for text on a console, also after the machine has ended."""

import pytest

from tests.proof.image.machine import Guest, NotSeenError


class Gone(Guest):
    """A machine whose console has said this and is over before anybody looks."""

    def __init__(self, said: str) -> None:
        self.text = ""
        self._from = 0
        self._is_over = False
        self._last = said

    def more(self, at: int, _limit_s: float) -> str:
        self.text, self._is_over = self._last, True
        return self.text[at:]


def test_last_words_are_heard():
    assert Gone("the answer is 42\n").wait(r"answer is (\d+)", 1.0)[1] == "42"


def test_a_machine_that_is_gone_is_not_waited_for():
    with pytest.raises(NotSeenError, match=r"(?s)'answer' was not seen.*something else"):
        Gone("something else\n").wait("answer", 1000.0)
