"""Commands at a watched shell: the whole answer is read."""

from collections.abc import Sequence
from typing import cast

from tests.proof.image.machine import Guest
from tests.proof.image.screen import Screen


class Said:
    """A guest that says this, piece by piece, once something is typed."""

    def __init__(self, pieces: Sequence[str]) -> None:
        self.text = ""
        self._pieces = list(pieces)

    def type(self, text: str) -> None:
        self.text += text

    def more(self, at: int, _limit_s: float) -> str:
        if len(self.text) <= at and self._pieces:
            self.text += self._pieces.pop(0)
        return self.text[at:]


def test_a_line_that_comes_in_two_pieces_is_read_once_the_prompt_is_back():
    screen = Screen(cast("Guest", Said(("\nRasp", "berry Pi 3\r\n", "operator@box:~$ "))))
    assert screen.run("model", "(?m)^Rasp.*$", 1.0).group() == "Raspberry Pi 3"
