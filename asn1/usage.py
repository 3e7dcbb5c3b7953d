"""Parser of the command line: accepts no abbreviations, suggests known words."""

import argparse
import difflib
from collections.abc import Iterable, Sequence
from typing import Any, NoReturn


class Parser(argparse.ArgumentParser):
    """Parser of the program or of one command. An error is the last line, and names the nearest known word."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **{"allow_abbrev": False, **options})

    def parse_known_args(  # type: ignore[override]
        self, args: Sequence[str] | None = None, namespace: argparse.Namespace | None = None
    ) -> tuple[argparse.Namespace, list[str]]:
        """Parse arguments, and refuse unknown ones: of a command in its own parser, so that the usage is the command's.

        Raises SystemExit with status 2 for a usage error.
        """
        options, unknown = super().parse_known_args(args, namespace)
        if unknown:
            self._refuse(unknown)
        return options, unknown

    def _refuse(self, unknown: Sequence[str]) -> NoReturn:
        """Report an unknown option or argument. An option is reported first: an argument after it may be its value."""
        option = next((one for one in unknown if one.startswith("-")), "").partition("=")[0]
        if not option:
            self.error(f"unexpected argument: {unknown[0]!r}; see {self.prog} --help")
        known = [one for action in self._actions if action.help != argparse.SUPPRESS for one in action.option_strings]
        self.error(f"unknown option: {option}; {_nearest(option, known) or f'see {self.prog} --help'}")

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is not None and value not in action.choices:
            what = "command" if isinstance(action, argparse._SubParsersAction) else "value"
            place = action if action.option_strings else None
            remedy = _nearest(value, action.choices) or f"known: {', '.join(action.choices)}"
            raise argparse.ArgumentError(place, f"unknown {what}: {value!r}; {remedy}")


def _nearest(word: str, known: Iterable[str]) -> str:
    """Return a question with the most similar known word; empty if none is similar."""
    alike = difflib.get_close_matches(word, known, n=1)
    return f"did you mean {alike[0]}?" if alike else ""
