"""Owner's documents: guide and README.txt of the card have valid examples and all LED codes."""

import re
from dataclasses import asdict
from pathlib import Path

from board.runtime import describe
from board.runtime.toml import parse
from firmware.card.station.part import STATE
from firmware.config.tables import RecorderOptions
from image import own_files
from tests.documents import blocks
from tests.firmware.card.conftest import KEY, Look

PROJECT = Path(__file__).resolve().parents[3]
GUIDE = (PROJECT / "image/guide/flash.md").read_text()
ON_CARD = (PROJECT / "image/first/README.txt").read_text()


def test_guide_box_toml_is_accepted(look: Look):
    (text,) = blocks(GUIDE, "toml box")
    found = look({"box.toml": text, "authorized_keys": KEY})
    assert [note.text for note in found.notes] == []
    assert (found.options.host_name, found.options.console.shell) == ("captain-7", True)


def test_card_text_box_toml_is_accepted(look: Look):
    text = ON_CARD[ON_CARD.index("host_name") : ON_CARD.index("  captain.toml ")]
    found = look({"box.toml": text, "authorized_keys": KEY})
    assert [note.text for note in found.notes] == []
    assert found.options.eth0 is not None
    assert found.options.console.shell is False


def test_guide_and_card_text_list_every_code_of_the_led():
    script = (PROJECT / "image/overlay/usr/lib/captain-image/blink").read_text()
    numbers = re.findall(r"^#   (\d)  ", script, re.MULTILINE)
    assert numbers == ["2", "3", "4"]
    assert all(f"| {number} | " in GUIDE for number in numbers)
    assert re.findall(r"^  (\d)   ", ON_CARD, re.MULTILINE) == numbers


def test_guide_and_card_text_warn_of_ports_without_authentication():
    for text in (GUIDE, ON_CARD):
        assert re.search(r"reaches\s+ports\s+5555\s+to\s+5558", text)
        assert re.search(r"without\s+authentication", text)


def test_card_text_recorder_is_accepted(look: Look):
    text = ON_CARD[ON_CARD.index("[recorder]") : ON_CARD.index("  board.toml ")]
    found = look({"captain.toml": text, "authorized_keys": KEY})
    assert [note.text for note in found.notes] == []


def test_box_configuration_sample_of_the_recorder_has_its_defaults(look: Look):
    text = (PROJECT / "image/overlay/etc/captain/captain.toml").read_text()
    assert "recorder" not in parse(text)
    sample = parse(re.sub("(?m)^# ?", "", text[text.index("# [recorder]") :]))["recorder"]
    assert asdict(describe.read(RecorderOptions, sample, "")) == asdict(RecorderOptions(folder="ring"))
    assert look({"captain.toml": re.sub("(?m)^# ?", "", text[text.index("# [recorder]") :])}).is_accepted


def test_socket_of_the_station_is_opened_by_no_other_program_of_the_box():
    # as firmware.card.station.part tells of ipc_in and ipc_out
    service = own_files.read("usr/lib/systemd/system/captain.service", own_files.CARD)
    assert "UMask=0027\n" in service


def test_place_where_the_station_may_write_is_that_of_its_service():
    service = own_files.read("usr/lib/systemd/system/captain.service", own_files.CARD)
    assert f"ReadWritePaths={STATE.rstrip('/')} " in service
    assert f"STATE_DIRECTORY={STATE.rstrip('/')}\n" in service
