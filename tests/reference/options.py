"""Page of options: the dataclasses of captain.toml, board files, box.toml, MQTT profiles and messages' options."""

import dataclasses
from typing import Any, NamedTuple, get_origin, get_type_hints

from drivers import DRIVERS
from drivers.wire.v2n.description import ProfileDescription
from firmware.card.box_file import BoxOptions
from firmware.config.board_file import Board
from firmware.config.tables import QueueOptions, Tables
from firmware.routing.options import RequestOptions
from tests.documents import anchor
from tests.reference.meanings import meanings, summary
from tests.reference.page import Page, Section, sentence, table
from tests.reference.values import default_of, inner_kind, long_default, unit_of, value_of


class Root(NamedTuple):
    """A file, or an object, whose keys are options.

    place  of the keys, as a user writes it.
    """

    title: str
    place: str
    kind: type
    text: str


ROOTS = (
    Root("Board file", "", Board, "The hardware of the box. `--board NAME` or `--board FILE` chooses it."),
    Root("Box file", "", BoxOptions, "`box.toml` on the first partition of the card."),
    Root("Profile file", "", ProfileDescription, '`profile` of an interface with `driver = "mqtt"` names it.'),
    Root("Message options", "", RequestOptions, "JSON object: the third frame of a message to port 5557."),
)


def page() -> Page:
    made = Page(
        "options",
        "Options",
        "Every option of `captain.toml`, board files, `box.toml`, MQTT profiles and messages to port 5557.",
        [],
    )
    for field in dataclasses.fields(Tables):
        _add(made, _title(field.name), _place(Tables, field.name), _kind(Tables, field.name))
        if field.name == "interfaces":
            _interfaces(made)
    for root in ROOTS:
        _add(made, root.title, root.place, root.kind, text=root.text)
    return made


def _interfaces(made: Page) -> None:
    made.sections.pop()
    names = ", ".join(f"[`{name}`](#{anchor(f'Interfaces: {name}')})" for name in DRIVERS)
    _add(made, "Interfaces", "[interfaces.NAME]", QueueOptions, text=f"{_about(QueueOptions)} Drivers: {names}.")
    for name in DRIVERS:
        options = DRIVERS[name].Options
        text = f'`driver = "{name}"`: {_about(options)}'
        _add(made, f"Interfaces: {name}", "[interfaces.NAME]", options, 3, text)


def _add(made: Page, title: str, place: str, kind: type | None, level: int = 2, text: str = "") -> None:
    """A section of a dataclass, and one of each dataclass below it."""
    if kind is None:
        made.sections.append(Section(title, "", level))
        return
    known, hints = meanings(kind), get_type_hints(kind, include_extras=True)
    rows, below = [], []
    for field in dataclasses.fields(kind):
        if not field.init:
            continue
        key = field.name.rstrip("_")
        inner = inner_kind(hints[field.name])
        meaning = known.get(field.name, "")
        if not meaning:
            made.missing.append(f"{kind.__module__}.{kind.__qualname__}: {field.name}: no meaning in its docstring")
        shown = value_of(hints[field.name], key)
        if inner is not None:
            below.append((f"{title}: {key}", _below(place, hints[field.name], key), inner))
            shown = f"[{shown}](#{anchor(below[-1][0])})"
        rows.append((f"`{key}`", shown, default_of(field), unit_of(key), sentence(meaning)))
    lines = [
        f"`{place}`" if place else "",
        text or _about(kind),
        table(("option", "value", "default", "unit", "meaning"), rows),
        *map(long_default, dataclasses.fields(kind)),
    ]
    made.sections.append(Section(title, "\n\n".join(filter(None, lines)), level))
    for name, where, inner in below:
        _add(made, name, where, inner, min(level + 1, 4))


def _about(kind: type) -> str:
    """The docstring's summary without the place in brackets that it may begin with."""
    text = summary(kind)
    if text.startswith("[") and "]: " in text:
        text = text.partition(": ")[2]
    return text[:1].upper() + text[1:]


def _title(name: str) -> str:
    return name.capitalize()


def _kind(kind: type, name: str) -> type | None:
    return inner_kind(get_type_hints(kind, include_extras=True)[name])


def _place(kind: type, name: str) -> str:
    return _below("", get_type_hints(kind, include_extras=True)[name], name)


def _below(place: str, hint: Any, key: str) -> str:
    """Return the place of the keys of a nested table."""
    path = f"{place.strip('[]')}.{key}" if place else key
    origin = get_origin(hint)
    if origin is tuple:
        return f"[[{path}]]"
    return f"[{path}.NAME]" if origin is dict else f"[{path}]"
