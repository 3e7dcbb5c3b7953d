"""Page of message types: messageID, name, BTP ports, traffic class, priority and lifetime."""

from collections.abc import Iterable

from firmware.topics import NAMELESS_IN_LEGACY, ROWS, TypeRow
from tests.reference.meanings import meanings
from tests.reference.page import Page, Section, sentence, table

TITLES = {
    "number": "messageID", "name": "type", "standard": "BTP port", "legacy": "in profile `legacy`",
    "priority": "priority", "lifetime": "lifetime in s", "traffic_class": "traffic class",
}  # fmt: skip
SUMMARY = (
    "Message types of the station. `[[types]]` in `captain.toml` adds or changes one: [options](options.md#types)."
)


def page() -> Page:
    made = Page("types", "Message types", SUMMARY, [])
    known = meanings(TypeRow)
    made.missing += [f"firmware.topics.TypeRow: {name}: no meaning" for name in TypeRow._fields if name not in known]
    made.sections.append(Section("Types", table([*TITLES.values()], map(_row, ROWS))))
    columns = [(TITLES[name], sentence(known.get(name, ""))) for name in TypeRow._fields]
    made.sections.append(Section("Columns", table(("column", "meaning"), columns)))
    return made


def _row(row: TypeRow) -> Iterable[str]:
    legacy = "not sent" if row.legacy is None else str(row.legacy)
    if row.number in NAMELESS_IN_LEGACY:
        legacy = f"no name, {legacy}"
    standard = "not sent" if row.standard is None else str(row.standard)
    return (
        str(row.number), f"`{row.name}`", standard, legacy, str(row.priority), f"{row.lifetime:g}", str(row.traffic_class),
    )  # fmt: skip
