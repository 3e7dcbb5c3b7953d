"""Parser of the command line: fits help to the terminal; suggests known words."""

import argparse
import re
import sys
from collections.abc import Iterable, Sequence
from itertools import groupby
from typing import Any, ClassVar, NoReturn

from board.runtime.errors import StationError, UsageError
from firmware.printable import failure_record, folded

# A word that begins like a negative number is a value, not an option. argparse does not recognise "-20.5,100" as one.
A_NUMBER = re.compile(r"-\.?\d")
USAGE_ERROR = 2
# First cell of a row in a help text, up to its second cell; in a line without cells, its indent.
TABLE_HEAD = re.compile(r" +(?:\S.*?  +(?=\S))?")


class _HelpFormatter(argparse.RawDescriptionHelpFormatter):
    """Formatter of help: folds too wide paragraphs as a whole, and too wide indented lines one by one."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        columns = width + 2  # argparse leaves two columns of the terminal free
        lines: list[str] = []
        for is_kept, several in groupby(text.strip().splitlines(), lambda line: not line or line[0] == " "):
            given = list(several)
            is_wide = any(len(line) > columns for line in given)
            lines += _folded([" ".join(given)] if is_wide and not is_kept else given, columns)
        return "\n".join(lines)

    def _format_usage(self, *arguments: Any) -> str:
        """Fold the usage. argparse itself does not fold a group of mutually exclusive options."""
        return "\n".join(_folded(super()._format_usage(*arguments).split("\n"), self._width + 2))


def _folded(lines: Iterable[str], columns: int) -> list[str]:
    """Fold each line that is too wide, with an indent below its text or below its second cell."""
    import textwrap

    folded = []
    for line in lines:
        head = TABLE_HEAD.match(line)
        hanging = " " * min(len(head[0]) if head else 0, columns // 2)
        short = textwrap.wrap(line, columns, subsequent_indent=hanging, break_on_hyphens=False)
        folded += short if len(line) > columns else [line]
    return folded


class Parser(argparse.ArgumentParser):
    """Parser of a command or subcommand.

    For a usage error, the last line is the error, with the nearest known word. With --json, the error is also printed
    as an object on standard output.

    is_json  True if the command line contains --json.
    """

    is_json: ClassVar[bool] = False

    def __init__(self, *arguments: Any, **options: Any) -> None:
        # Abbreviations are disabled: argparse would take `--js` as --json, which firmware.cli does not find in argv.
        super().__init__(*arguments, **{"formatter_class": _HelpFormatter, "allow_abbrev": False, **options})
        self._negative_number_matcher = A_NUMBER

    def parse_args(self, args: Sequence[str], namespace: None = None) -> argparse.Namespace:  # type: ignore[override]
        options, unknown = self.parse_known_args(args, namespace)
        if unknown:
            self._chosen(args)._refuse(unknown)
        return options

    def error(self, message: str) -> NoReturn:
        if self.is_json:
            print_json(UsageError(message, f"{self.prog} --help"))
        self.print_usage(sys.stderr)
        self.exit(USAGE_ERROR, folded(f"{self.prog}: error: {message}\n", sys.stderr))

    def _check_value(self, action: argparse.Action, value: object) -> None:
        if action.choices is not None and value not in action.choices:
            what = "command" if isinstance(action, argparse._SubParsersAction) else "value"
            place = action if action.option_strings else None
            from board.runtime.describe import remedy

            raise argparse.ArgumentError(place, f"unknown {what}: {value!r}; {remedy(value, action.choices)}")

    def _chosen(self, args: Sequence[str]) -> "Parser":
        """Return the parser of the subcommand in the arguments; this parser if they name none."""
        for action in self._actions:
            if isinstance(action, argparse._SubParsersAction):
                return next((action.choices[one]._chosen(args) for one in args if one in action.choices), self)
        return self

    def _refuse(self, unknown: Sequence[str]) -> NoReturn:
        """Report an unknown option or argument. An option is reported first: an argument after it may be its value."""
        option = next((one for one in unknown if one.startswith("-")), "")
        if not option:
            self.error(f"unexpected argument: {unknown[0]!r}; see {self.prog} --help")
        name = option.partition("=")[0]
        known = [one for one in self._option_string_actions if one.startswith("--")]
        from board.runtime.describe import did_you_mean

        self.error(f"unknown option: {name}; {did_you_mean(name, known) or f'see {self.prog} --help'}")


def print_json(error: StationError) -> None:
    """Print a failure as an object on standard output."""
    import json

    print(json.dumps(failure_record(error)), flush=True)
