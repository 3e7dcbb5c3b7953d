"""Page of drop reasons, and of reasons for which a message is implausible."""

from collections.abc import Iterator

from drivers import implausible, reason
from drivers.implausible import Implausible
from drivers.reason import Reason
from tests.reference.meanings import meanings
from tests.reference.page import Page, Section, sentence, table

SUMMARY = (
    "Every message that the station does not pass on has one of these reasons, in status, confirms and the journal."
)


def page() -> Page:
    made = Page("drops", "Drop reasons", SUMMARY, [])
    made.missing += [f"drivers.reason.MEANING: no row for {one}" for one in Reason if one not in reason.MEANING]
    made.missing += [
        f"drivers.implausible.MEANING: no row for {one}" for one in Implausible if one not in implausible.MEANING
    ]
    notes = meanings(Reason)
    for title, reasons in _groups():
        rows = [(f"`{one}`", sentence(reason.MEANING.get(one, "")), sentence(notes.get(one, ""))) for one in reasons]
        made.sections.append(Section(title, table(("reason", "meaning", "notes"), rows)))
    notes = meanings(Implausible)
    rows = [
        (f"`{one}`", sentence(implausible.MEANING.get(one, "")), sentence(notes.get(one, ""))) for one in Implausible
    ]
    text = "A message with one of these reasons is marked and delivered, unless a row of the policy drops it."
    made.sections.append(Section("Implausible messages", f"{text}\n\n{table(('reason', 'meaning', 'notes'), rows)}"))
    return made


def _groups() -> Iterator[tuple[str, list[Reason]]]:
    """Reasons by where a message was dropped, in the order of the enumeration."""
    titles = {first: title for title, first in reason.GROUPS.items()}
    title, found = "", []
    for one in Reason:
        if one in titles:
            if found:
                yield title, found
            title, found = titles[one], []
        found.append(one)
    yield title, found
