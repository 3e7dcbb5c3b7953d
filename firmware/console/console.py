"""Status screen on one terminal: contents, keys, and timing of frames."""

import signal
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from board.runtime.errors import StationError
from board.runtime.loop import Loop, Timer
from board.runtime.signals import Signals
from firmware.console.keys import AGAIN, BACK, INTERRUPT, NEXT, Keys
from firmware.console.pages import BESIDE, pages, screen
from firmware.console.paint import Painter, Printer
from firmware.console.sheet import Facts, head, sections, shown
from firmware.console.shell import Shell
from firmware.console.survey import Survey
from firmware.console.terminal import Terminal

EVERY_S = 2.0
# Interval of complete redraws, for a terminal that was plugged in later, and because the kernel also writes on a
# console.
WHOLE_S = 10.0
RETRY_S = 0.25  # delay before the retry of a frame when the line was busy; sending a complete frame takes 0.17 s
INTERRUPTED = 130

HELP = (
    "Status screen of a station, which routes V2X messages.",
    "",
    "  n, space, arrow down   next page",
    "  p, arrow up            previous page",
    "  r, Enter               read all values again and redraw",
    "  h                      this help; any key returns",
)
HELP_SHELL = "  s                      open a shell here; `exit` returns"
HELP_QUIT = "  q, Ctrl-C              quit"
HELP_MORE = (
    "",
    "In a shell: `captain status` and `captain time` show more, `captain doctor`",
    "shows faults and remedies, `captain listen` shows received messages,",
    "`captain --help` lists all commands.",
    "",
    "in/s, out/s: messages per second. drops: messages not passed on.",
    "Lines with ! are from the start of this machine.",
)


@dataclass(frozen=True)
class Options:
    """Options of the command line.

    control   candidate control sockets of the station.
    notes     path of the file with notes; empty: none.
    shell     command of the key s; empty: no shell.
    is_plain  no escape codes: each screen is printed below the previous one.
    every_s   interval of the screens, s.
    stays     no key quits, because the console is a service.
    """

    control: Sequence[str]
    notes: str = ""
    shell: Sequence[str] = ()
    is_plain: bool = False
    every_s: float = EVERY_S
    stays: bool = False


class Console:
    """Serves one terminal until the user quits or it hangs up. Raises InterfaceError without a terminal."""

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

    # -- events

    def _look(self) -> None:
        if self._shell is None:
            self._is_awaited = True
            self._survey.look()

    def _changed(self) -> None:
        """Show new values: at once if drawn in place; if printed, when all answers have come."""
        if not self._options.is_plain:
            self._draw()
        elif self._is_awaited and self._survey.is_complete:
            self._is_awaited = False
            self._draw()

    def _typed(self, octets: bytes) -> None:
        self._act(self._keys.receive(octets, self._loop.clock()))
        self._listen()

    def _listen(self) -> None:
        """Start the timer that ends a burst of input, unless it runs: keys are known only after a quiet moment."""
        due = self._keys.deadline()
        if self._listening is None and due is not None:
            self._listening = self._loop.after(due - self._loop.clock(), self._quiet)

    def _quiet(self) -> None:
        self._listening = None
        self._act(self._keys.expire(self._loop.clock()))
        self._listen()

    def _act(self, keys: Sequence[str]) -> None:
        for key in keys:
            if self._shell is not None:  # an earlier key of the same burst opened the shell
                return
            was_help, self._is_help, self._message = self._is_help, False, ""
            act = self._acts.get(key)
            if act is not None:
                act()
            elif not was_help:
                self._message = f"unknown key {key!r}; h lists the keys"
            self._again()

    def _interrupt(self) -> None:
        self.status = INTERRUPTED
        self._leave()

    def _leave(self) -> None:
        self._loop.stop()

    # -- actions of keys

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
        self._message = f"the shell ended with status {status}" if status else ""
        self._terminal.take()
        self._survey.look()
        self._again()

    # -- output

    def _again(self) -> None:
        """Draw the complete screen, because its content is unknown or the user asked for it."""
        self._painter.forget()
        self._draw()

    def _draw(self) -> None:
        """Draw a frame if the terminal has taken the previous one; else retry later, with a single timer."""
        if self._shell is not None or self._retrying is not None:
            return
        if not self._terminal.is_free:
            if not self._terminal.is_stopped:  # a stopped terminal drops this frame; the next look() brings another
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
    """Return all pages as text, after all answers came or timed out, and whether a station answered."""

    def changed() -> None:
        if survey.is_complete:
            loop.stop()

    survey = Survey(loop, control, notes, changed)
    survey.look()
    loop.run()
    facts = survey.facts()
    lines = [shown(head(facts), width), *(line for section in sections(facts, width) for line in section)]
    return "".join(f"{line}\n" for line in lines), survey.is_answered
