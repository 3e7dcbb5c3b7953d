"""Reference pages: as the code has them; a new option, reason, key or command is noticed."""

import argparse
import dataclasses
import inspect
import sys
from enum import StrEnum
from pathlib import Path
from types import SimpleNamespace

import pytest

from drivers import reason
from firmware.config.tables import QueueOptions
from image.manual import files
from tests.reference import commands, drops, options, topics
from tests.reference.page import MissingError
from tests.reference.pages import FOLDER, ROOT, written

FILES = [*sorted(FOLDER.glob("*.md")), ROOT / "tests/reference/links.txt", ROOT / "firmware/guide/data-flow.svg"]
# Keys of values that are made elsewhere: of a chip, a sensor or a fan; of the status, by their names.
FROM_VALUES = frozenset({"v", "a", "w", "c", "rpm", "percent"})


@pytest.fixture(scope="module")
def texts() -> dict[Path, str]:
    return written()


def committed(name: str) -> str:
    return (FOLDER / f"{name}.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_reference_file_is_as_the_code_has_it(texts: dict[Path, str], path: Path) -> None:
    assert path.read_text(encoding="utf-8") == texts[path], "run `make reference` and commit what it has written"


def test_reference_has_no_other_files(texts: dict[Path, str]) -> None:
    assert set(texts) == set(FILES)


def test_new_option_without_meaning_is_missing_and_with_one_changes_the_page(monkeypatch: pytest.MonkeyPatch) -> None:
    longer = dataclasses.make_dataclass("Longer", [("burst", int, 1)], bases=(QueueOptions,), frozen=True)
    monkeypatch.setattr(options, "QueueOptions", longer)
    longer.__doc__ = None
    with pytest.raises(MissingError, match="Longer: burst"):
        options.page().text()
    longer.__doc__ = "Options.\n\nburst  number of messages that may leave at once."
    assert "| `burst` | integer | `1` |  | Number of messages that may leave at once. |" in options.page().text()
    assert options.page().text() != committed("options")


def test_new_drop_reason_without_meaning_is_missing_and_with_one_changes_the_page(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    longer = StrEnum("Reason", [*((one.name, one.value) for one in reason.Reason), ("NEW", "new-reason")])
    monkeypatch.setattr(drops, "Reason", longer)
    with pytest.raises(MissingError, match="new-reason"):
        drops.page().text()
    monkeypatch.setitem(reason.MEANING, longer("new-reason"), "it is new")  # type: ignore[index]
    assert "| `new-reason` | It is new. |" in drops.page().text()
    assert drops.page().text() != committed("drops")


def test_new_key_of_a_report_is_undocumented_and_with_a_meaning_changes_the_page(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    status = {
        "station": "mine",
        "interfaces": {"g5": {"queue": {"length": 1}, "received": {"cam": 3}, "details": {"x": 1}}},
    }
    assert topics.undocumented("status", status) == []
    status["interfaces"]["g5"] |= {"burst": 1, "queue": {"burst": 2}}  # type: ignore[index]
    new = {"status.interfaces.g5.burst", "status.interfaces.g5.queue.burst"}
    assert set(topics.undocumented("status", status)) == new

    def added() -> None:
        """Add one.

        burst  number of messages.
        """

    more = [one._replace(sources=(*one.sources, topics.Source(added))) for one in topics.PARTS]
    monkeypatch.setattr(topics, "PARTS", more)
    assert "| `burst` | Number of messages. |" in topics.page().text()
    assert topics.page().text() != committed("topics")


def test_new_command_without_help_is_missing_and_with_help_changes_the_page(monkeypatch: pytest.MonkeyPatch) -> None:
    def arguments(parser: argparse.ArgumentParser) -> None:
        parser.add_argument("--loud", action="store_true", help=help_of_it)

    for module in (commands, files):
        monkeypatch.setattr(module, "VERBS", commands.VERBS | {"shout": "say it louder"})
    new = SimpleNamespace(DESCRIPTION="Says it.", EPILOG="", arguments=arguments)
    before = files.load
    monkeypatch.setattr(files, "load", lambda verb: new if verb == "shout" else before(verb))
    help_of_it = None
    with pytest.raises(MissingError, match="captain shout: --loud"):
        commands.page().text()
    help_of_it = "in capitals"
    assert (
        "## captain shout\n\n```text\nSays it.\n\noptions:\n  --loud                in capitals\n"
        in commands.page().text()
    )
    assert commands.page().text() != committed("commands")


@pytest.mark.parametrize("part", topics.PARTS, ids=lambda part: part.title)
def test_key_with_a_meaning_is_one_that_its_module_makes(part: topics.Part) -> None:
    stale = []
    for source in part.sources:
        if isinstance(source.of, type):
            names = set(source.of._fields)  # type: ignore[attr-defined]
            stale += [key for key in source.rows() if key not in names]
        else:
            code = inspect.getsource(sys.modules[source.of.__module__])
            last = [(key, key.split(".")[-1]) for key in source.rows()]
            stale += [key for key, name in last if f'"{name}"' not in code and name not in FROM_VALUES]
    assert stale == []
