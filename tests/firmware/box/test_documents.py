"""What README and the card's README.txt tell an owner to write is taken."""

import re
from dataclasses import asdict
from pathlib import Path

import pytest

from board import describe
from board.toml import parse
from firmware.box.station import STATE
from firmware.tables import RecorderOptions
from tests.firmware.box.conftest import KEY, Files, Look

PROJECT = Path(__file__).resolve().parents[3]
README = (PROJECT / "README.md").read_text()
ON_CARD = (PROJECT / "image/first/README.txt").read_text()


def test_box_toml_of_the_readme_is_taken(look: Look):
    (text,) = re.findall(r"^```toml box\n(.*?)^```", README, re.MULTILINE | re.DOTALL)
    found = look({"box.toml": text, "authorized_keys": KEY})
    assert [note.text for note in found.notes] == []
    assert (found.options.host_name, found.options.console.shell) == ("captain-7", True)


def test_box_toml_of_the_cards_own_text_is_taken(look: Look):
    text = ON_CARD[ON_CARD.index("host_name") : ON_CARD.index("  captain.toml ")]
    found = look({"box.toml": text, "authorized_keys": KEY})
    assert [note.text for note in found.notes] == []
    assert found.options.eth0 is not None
    assert found.options.console.shell is False


def test_both_tell_every_number_that_the_led_blinks():
    script = (PROJECT / "image/overlay/usr/lib/captain-image/blink").read_text()
    numbers = re.findall(r"^#   (\d)  ", script, re.MULTILINE)
    assert numbers == ["2", "3", "4"]
    assert all(f"| {number} | " in README for number in numbers)
    assert re.findall(r"^  (\d)   ", ON_CARD, re.MULTILINE) == numbers


def test_both_say_who_may_use_the_box_without_being_asked():
    for text in (README, ON_CARD):
        assert re.search(r"reaches\s+ports 5555 to 5558", text)
        assert re.search(r"(?i)nobody\s+is\s+asked\s+who\s+he\s+is", text)


def test_the_flight_recorder_is_switched_on_by_what_the_card_says(look: Look):
    text = ON_CARD[ON_CARD.index("[recorder]") : ON_CARD.index("  board.toml ")]
    found = look({"captain.toml": text, "authorized_keys": KEY})
    assert [note.text for note in found.notes] == []


def test_the_boxs_own_configuration_shows_the_recorder_as_it_is_by_default(look: Look):
    text = (PROJECT / "image/overlay/etc/captain/captain.toml").read_text()
    assert "recorder" not in parse(text)
    sample = parse(re.sub("(?m)^# ?", "", text[text.index("# [recorder]") :]))["recorder"]
    assert asdict(describe.read(RecorderOptions, sample, "")) == asdict(RecorderOptions(folder="ring"))
    assert look({"captain.toml": re.sub("(?m)^# ?", "", text[text.index("# [recorder]") :])}).is_accepted


@pytest.mark.parametrize("folder", ["/data/captain/ring", "/media/usb", "../ring", "/var/lib/captain/../x"])
def test_a_folder_that_the_service_keeps_the_station_from_is_told(look: Look, folder: str):
    found = look({"captain.toml": f'[recorder]\nfolder = "{folder}"\n', "authorized_keys": KEY})
    (note,) = found.notes
    assert note.text.startswith("captain.toml:2: recorder.folder: the station cannot write ")
    assert found.is_accepted


@pytest.mark.parametrize("name", ["ipc_in", "ipc_out"])
def test_a_socket_that_no_program_of_the_box_may_open_is_told(look: Look, name: str):
    service = (PROJECT / "image/overlay/usr/lib/systemd/system/captain.service").read_text()
    assert "UMask=0027\n" in service
    files: Files = {"captain.toml": f'[endpoint]\n{name} = "ipc:///tmp/v2x/in/0"\n', "authorized_keys": KEY}
    (note,) = look(files).notes
    said = f"captain.toml:2: endpoint.{name}: no other program of a box may open ipc:///tmp/v2x/in/0; leave it out"
    assert (note.text, note.is_mistake) == (said, False)


@pytest.mark.parametrize("folder", ["ring", "rings/one", "/var/lib/captain/ring", ""])
def test_one_that_it_may_write_is_taken_without_a_word(look: Look, folder: str):
    assert look({"captain.toml": f'[recorder]\nfolder = "{folder}"\n', "authorized_keys": KEY}).notes == []


def test_where_the_station_may_write_is_what_its_service_says():
    service = (PROJECT / "image/overlay/usr/lib/systemd/system/captain.service").read_text()
    assert f"ReadWritePaths={STATE.rstrip('/')} " in service
    assert f"STATE_DIRECTORY={STATE.rstrip('/')}\n" in service
