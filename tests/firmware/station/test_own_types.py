"""Own message types that are registered while a station runs."""

import logging
import os
from contextlib import closing
from pathlib import Path

import pytest

from drivers.message import MessageType
from firmware.station.own_types import LOOK_S, OwnTypes
from firmware.topics import Topics
from tests.virtual import VirtualLoop

ROW = '[[types]]\nnumber = 200\nname = "hello"\nbtp_port = 3000\n'


class Watched:
    """A table of types, the file that is watched, and the types that were taken."""

    def __init__(self, loop: VirtualLoop, file: Path) -> None:
        self.loop = loop
        self.file = file
        self.topics = Topics()
        self.taken: list[MessageType] = []
        OwnTypes(loop, self.topics, self.taken.append).start()

    def write(self, text: str) -> None:
        """Write the file by rename, as captain-asn1 does, and let the loop look at it."""
        new = self.file.with_suffix(".new")
        new.write_text(text)
        os.replace(new, self.file)
        self.loop.run_for(2 * LOOK_S)


@pytest.fixture
def watched(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("CAPTAIN_TYPES", str(tmp_path / "types.toml"))
    with closing(VirtualLoop()) as loop:
        yield Watched(loop, tmp_path / "types.toml")


def test_new_row_is_added_once_and_sent_by_its_envelope_and_messageid(watched: Watched) -> None:
    watched.write(ROW)
    watched.write(ROW + "# the same\n")
    (kind,) = watched.taken
    topics = watched.topics
    assert (kind.name, kind.number, kind.btp_port) == ("hello", 200, 3000)
    assert topics.by_envelope[b"v2x.hello."] is topics.by_number[200] is topics.kinds[kind.row] is kind
    assert topics.envelopes[kind.row] == b"v2x.hello."
    assert 3000 in topics.ports


@pytest.mark.parametrize("row", ['number = 2\nname = "mine"', 'number = 201\nname = "cam"'])
def test_row_with_a_messageid_or_name_that_is_taken_is_not_added(watched: Watched, row: str) -> None:
    watched.write(f"[[types]]\n{row}\nbtp_port = 3000\n")
    assert watched.taken == []
    assert [kind.name for kind in watched.topics.kinds].count("cam") == 1


def test_row_that_was_written_before_the_start_is_taken(watched: Watched) -> None:
    watched.file.write_text(ROW)
    watched.loop.run_for(LOOK_S)
    assert [kind.name for kind in watched.taken] == ["hello"]


def test_changed_row_is_reported_and_not_applied(watched: Watched, caplog: pytest.LogCaptureFixture) -> None:
    watched.write(ROW)
    watched.write(ROW.replace("3000", "3001"))
    assert "restart the station" in caplog.text
    assert watched.topics.by_number[200].btp_port == 3000


def test_invalid_file_is_reported_and_its_correction_taken(watched: Watched, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.ERROR):
        watched.write("[[types]]\nnumber = 999\n")
    assert "999" in caplog.text
    watched.write(ROW)
    assert [kind.name for kind in watched.taken] == ["hello"]


def test_removed_file_leaves_the_types_in_force(watched: Watched) -> None:
    watched.write(ROW)
    watched.file.unlink()
    watched.loop.run_for(2 * LOOK_S)
    assert watched.topics.by_number[200].name == "hello"
