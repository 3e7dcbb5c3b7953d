"""The modules of one kind that a station has, receivers or modems: found, shown, and the one that is meant asked."""

import argparse
import json
from collections.abc import Callable, Iterable, Mapping
from typing import NamedTuple

from board.errors import StationError
from firmware.user import client
from firmware.user.arguments import address
from firmware.user.table import Screen, Table, span
from firmware.user.untrusted import named, number, text

Modules = dict[str, dict[str, object]]


class Kind(NamedTuple):
    """A kind of module.

    word    for one of them, and title: the same in full.
    key     of an interface's status that tells the kind; values: what it then holds.
    driver  that makes an interface one.
    naming  what stands on the command line in front of a name; empty: nothing.
    """

    word: str
    title: str
    key: str
    values: tuple[str, ...]
    driver: str
    naming: str = ""


def found(options: argparse.Namespace, kind: Kind) -> Modules:
    """The interfaces of this kind, or the one that is asked for. Raises StationError where there is none."""
    status = client.status(address(options), options.control)
    every = {name: one for name, one in named(status, "interfaces") if text(one, kind.key) in kind.values}
    if not every:
        remedy = f'captain.toml: an interface with driver = "{kind.driver}"'
        raise StationError(f"the station has no {kind.title}", remedy)
    if not options.interface:
        return every
    if options.interface not in every:
        raise StationError(f"the station has no {kind.word} {options.interface!r}", f"it has {', '.join(every)}")
    return {options.interface: every[options.interface]}


def the_only(modules: Modules, kind: Kind) -> str:
    """Name of the one that is meant. Raises StationError where several may be."""
    if len(modules) > 1:
        names = ", ".join(modules)
        raise StationError(f"the station has {len(modules)} {kind.word}s", f"{kind.naming or 'name'} one of {names}")
    return next(iter(modules))


def show(modules: Modules, is_json: bool, table: Callable[[str, Mapping[str, object]], Table]) -> None:
    """Print what is known of them."""
    if is_json:
        print(json.dumps(modules))
    else:
        Screen().show([table(name, one) for name, one in modules.items()])


def operate(
    options: argparse.Namespace, name: str, timeout: float = client.ANSWER_S, **more: object
) -> dict[str, object]:
    """Ask one of them what the options say; more are the arguments of that. Raises StationError."""
    place = address(options)
    answer = client.ask_local(
        place, options.control, "operate", timeout, interface=name, ask=options.ask, arguments=more
    )
    return {key: value for key, value in answer.items() if key != "ok"}


def rows_of(name: str, one: Mapping[str, object], rows: Iterable[tuple[str, str]], notes: Iterable[str] = ()) -> Table:
    """The table of a module: its link, and the rows that say something."""
    title = f"{name}: {text(one, 'state')} for {span(number(one, 'since_s'))}: {text(one, 'why')}"
    return Table(title, ("what", "value"), [row for row in rows if row[1]], list(notes))


def joined(*words: str) -> str:
    """Those that say something, with commas."""
    return ", ".join(filter(None, words))
