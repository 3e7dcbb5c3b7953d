"""The status screen on one terminal: what is shown, what keys do, and when a frame leaves."""

import signal
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from board.errors import StationError
from board.loop import Loop, Timer
from board.signals import Signals
from firmware.console.keys import AGAIN, BACK, INTERRUPT, NEXT, Keys
from firmware.console.pages import BESIDE, pages, screen
from firmware.console.paint import Painter, Printer
from firmware.console.sheet import Facts, head, sections, shown
from firmware.console.shell import Shell
from firmware.console.survey import Survey
from firmware.console.terminal import Terminal

EVERY_S = 2.0
# A terminal that was plugged in later has seen nothing yet, and the kernel writes on a console too.
WHOLE_S = 10.0
RETRY_S = 0.25  # until a frame that found the line busy is tried again: a whole one takes 0.17 s
INTERRUPTED = 130

HELP = (
    "This is the status screen of a station: a router of V2X messages.",
    "",
    "  n, space, arrow down   the next page",
    "  p, arrow up            the page before",
    "  r, Enter               all of it again, and this page drawn anew",
    "  h                      this text; any key goes back",
)
HELP_SHELL = "  s                      a shell on this terminal; `exit` comes back here"
HELP_QUIT = "  q, Ctrl-C              the end of this program"
HELP_MORE = (
    "",
    "In a shell: `captain status` and `captain time` say more, `captain doctor`",
    "what is wrong and what to do, `captain listen` what is received,",
    "`captain --help` the rest.",
    "",
    "in/s, out/s: messages a second. drops: messages that were not passed on.",
    "Lines with ! are from the start of this machine.",
)


@dataclass(frozen=True)
class Options:
    """What the command line wants.

    shell     command of the key s, empty where there is none.
    is_plain  no escape codes: a screen below the other, every every_s.
    stays     no key ends it: it is a service.
    """

    control: Sequence[str]
    notes: str = ""
    shell: Sequence[str] = ()
    is_plain: bool = False
    every_s: float = EVERY_S
    stays: bool = False


class Console:
    """Serves one terminal until somebody leaves or it hangs up. Raises InterfaceError where there is none."""

    def __init__(self, loop: Loop, descriptor: int, options: Options) -> None:
        self.status = 0
        self._loop = loop
        self._options = options
        self._painter = Printer() if options.is_plain else Painter()
        self._keys = Keys()
        self._listening: Timer | None = None
        self._retrying: Timer | None = None
        self._shell: Shell | None = None
        self._page = 0
        self._message = ""
        self._is_help = False
        self._is_awaited = False
        self._survey = Survey(loop, options.control, options.notes, self._changed)
        self._terminal = Terminal(loop, descriptor, self._typed, self._leave)
        self._signals = Signals(
            loop,
            {
                signal.SIGHUP: self._leave,
                signal.SIGTERM: self._leave,
                signal.SIGINT: self._interrupt,
                signal.SIGWINCH: self._again,
            },
        )
        self._acts: dict[str, Callable[[], None]] = {
            NEXT: lambda: self._turn(1),
            BACK: lambda: self._turn(-1),
            AGAIN: lambda: self._turn(0),
            "h": self._show_help,
            **({"s": self._open_shell} if options.shell else {}),
            **({} if options.stays else {"q": self._leave, INTERRUPT: self._interrupt}),
        }

    def start(self) -> None:
        self._loop.every(self._options.every_s, self._look)
        if not self._options.is_plain:
            self._loop.every(WHOLE_S, self._again)

    def close(self) -> None:
        """Give the terminal back; idempotent."""
        if self._shell is not None:
            self._shell.hang_up()
        self._survey.leave()
        self._terminal.close()
        self._signals.close()

    # -- what comes

    def _look(self) -> None:
        if self._shell is None:
            self._is_awaited = True
            self._survey.look()

    def _changed(self) -> None:
        """Something is known anew. In place it is shown at once; printed when all of it has come."""
        if not self._options.is_plain:
            self._draw()
        elif self._is_awaited and self._survey.is_complete:
            self._is_awaited = False
            self._draw()

    def _typed(self, octets: bytes) -> None:
        self._act(self._keys.receive(octets, self._loop.clock()))
        self._listen()

    def _listen(self) -> None:
        """Once the line is quiet it is known what was typed; one timer, however much is."""
        due = self._keys.deadline()
        if self._listening is None and due is not None:
            self._listening = self._loop.after(due - self._loop.clock(), self._quiet)

    def _quiet(self) -> None:
        self._listening = None
        self._act(self._keys.expire(self._loop.clock()))
        self._listen()

    def _act(self, keys: Sequence[str]) -> None:
        for key in keys:
            if self._shell is not None:  # a key that was held down has opened it
                return
            was_help, self._is_help, self._message = self._is_help, False, ""
            act = self._acts.get(key)
            if act is not None:
                act()
            elif not was_help:
                self._message = f"the key {key!r} means nothing here; h shows those that do"
            self._again()

    def _interrupt(self) -> None:
        self.status = INTERRUPTED
        self._leave()

    def _leave(self) -> None:
        self._loop.stop()

    # -- what keys do

    def _turn(self, pages_on: int) -> None:
        self._page += pages_on
        if not pages_on:
            self._survey.look()

    def _show_help(self) -> None:
        self._is_help = True

    def _open_shell(self) -> None:
        self._terminal.say(b"\r\n")
        self._terminal.lend()
        try:
            self._shell = Shell(self._loop, self._options.shell, self._terminal.given, self._shell_ended)
        except StationError as error:
            self._message = f"no shell: {error.message}"
            self._terminal.take()

    def _shell_ended(self, status: int) -> None:
        self._shell = None
        self._message = f"the shell has ended, with status {status}" if status else ""
        self._terminal.take()
        self._survey.look()
        self._again()

    # -- what is shown

    def _again(self) -> None:
        """Draw all of it: what is on the screen is not known, or somebody has asked."""
        self._painter.forget()
        self._draw()

    def _draw(self) -> None:
        """Give a frame to the terminal, if it has taken the one before; otherwise try again: there is one at most."""
        if self._shell is not None or self._retrying is not None:
            return
        if not self._terminal.is_free:
            if not self._terminal.is_stopped:  # otherwise this frame is dropped, and the next look brings another
                self._retrying = self._loop.after(RETRY_S, self._retry)
            return
        octets = self._painter.frame(self._frame())
        if octets:
            self._terminal.draw(octets)

    def _retry(self) -> None:
        self._retrying = None
        self._draw()

    def _frame(self) -> list[str]:
        facts = self._survey.facts()
        width, height = self._terminal.size
        found = [self._help()] if self._is_help else pages(sections(facts, width), max(1, height - BESIDE))
        self._page %= len(found)
        lines = screen(self._head(facts, len(found)), found[self._page], self._said(), self._menu(len(found)), height)
        return [shown(line, width) for line in lines]

    def _head(self, facts: Facts, count: int) -> str:
        return head(facts) + (f"  page {self._page + 1}/{count}" if count > 1 else "")

    def _said(self) -> str:
        noise = f"{self._keys.noise} octets of noise on the line" if self._keys.noise else ""
        return self._message or noise

    def _menu(self, count: int) -> str:
        offered = (
            ("s shell", "s" in self._acts),
            (f"n next page ({(self._page + 1) % count + 1})", count > 1),
            ("r refresh", True),
            ("h help", True),
            ("q quit", "q" in self._acts),
        )
        return "keys: " + ", ".join(words for words, is_offered in offered if is_offered) + " "

    def _help(self) -> list[str]:
        shell = (HELP_SHELL,) if "s" in self._acts else ()
        quits = (HELP_QUIT,) if "q" in self._acts else ()
        return [*HELP, *shell, *quits, *HELP_MORE]


def once(loop: Loop, control: Sequence[str], notes: str, width: int) -> tuple[str, bool]:
    """All pages as text, once everything has answered, and whether a station did; each answer has its own limit."""

    def changed() -> None:
        if survey.is_complete:
            loop.stop()

    survey = Survey(loop, control, notes, changed)
    survey.look()
    loop.run()
    facts = survey.facts()
    lines = [shown(head(facts), width), *(line for section in sections(facts, width) for line in section)]
    return "".join(f"{line}\n" for line in lines), survey.is_answered
