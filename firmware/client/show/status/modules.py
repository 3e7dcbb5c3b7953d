"""Modules of one kind, receivers or modems: finds, shows and operates them."""

import argparse
import json
from collections.abc import Callable, Iterable, Mapping
from typing import NamedTuple

from board.runtime.errors import StationError
from firmware.client import client
from firmware.client.arguments import address
from firmware.client.show.table import Screen, Table, span
from firmware.untrusted import named, number, text

Modules = dict[str, dict[str, object]]


class Kind(NamedTuple):
    """Kind of module, receiver or modem.

    word    short name of the kind in messages.
    title   full name of the kind in messages.
    key     key of an interface's status that identifies the kind.
    values  values of this key for this kind.
    driver  driver of such an interface, for hints.
    naming  command-line option that names a module; empty if the name is a plain argument.
    """

    word: str
    title: str
    key: str
    values: tuple[str, ...]
    driver: str
    naming: str = ""


def found(options: argparse.Namespace, kind: Kind) -> Modules:
    """Return the status of all interfaces of this kind, or of the one that the options name.

    Raises StationError if the station has no such interface.
    """
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
    """Return the name of the only module. Raises StationError if there are several."""
    if len(modules) > 1:
        names = ", ".join(modules)
        raise StationError(f"the station has {len(modules)} {kind.word}s", f"{kind.naming or 'name'} one of {names}")
    return next(iter(modules))


def show(modules: Modules, is_json: bool, table: Callable[[str, Mapping[str, object]], Table]) -> None:
    """Print the status of the modules as JSON or as tables."""
    if is_json:
        print(json.dumps(modules))
    else:
        Screen().show([table(name, one) for name, one in modules.items()])


def operate(
    options: argparse.Namespace, name: str, timeout: float = client.ANSWER_S, **more: object
) -> dict[str, object]:
    """Send the command of the options to one module, and return its answer without `ok`.

    name     interface of the module.
    timeout  seconds that the station may take.
    more     arguments of the command.

    Raises StationError if the station refuses, or does not answer.
    """
    place = address(options)
    answer = client.ask_local(
        place, options.control, "operate", timeout, interface=name, ask=options.ask, arguments=more
    )
    return {key: value for key, value in answer.items() if key != "ok"}


def rows_of(name: str, one: Mapping[str, object], rows: Iterable[tuple[str, str]], notes: Iterable[str] = ()) -> Table:
    """Return the table of one module: the state of its link as title, and all rows with a value."""
    title = f"{name}: {text(one, 'state')} for {span(number(one, 'since_s'))}: {text(one, 'why')}"
    return Table(title, ("what", "value"), [row for row in rows if row[1]], list(notes))


def joined(*words: str) -> str:
    """Join the nonempty texts with commas."""
    return ", ".join(filter(None, words))
