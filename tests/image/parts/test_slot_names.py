"""Names of the modules' ports by their slots."""

import re
import tomllib
from pathlib import Path

from image.parts import slot_names

BOARDS = Path(__file__).resolve().parents[3] / "board/boards"
QUAD = tomllib.loads((BOARDS / "quad.toml").read_text())


def test_each_slot_with_a_place_has_a_rule_for_what_is_plugged_in_there():
    said = slot_names.rules(QUAD)
    assert re.findall('KERNELS=="([^"]*)".*slot/([a-z0-9]+)-', said) == [
        ("1-1.1.4:*", "cellular"),
        ("1-1.1.2:*", "free"),
        ("1-1.1.1:*", "gnss"),
        ("1-1.1.3:*", "v2x"),
    ]


def test_a_name_ends_with_the_number_of_the_interface_which_a_data_sheet_has():
    (rule,) = (line for line in slot_names.rules(QUAD).splitlines() if "1-1.1.4" in line)
    # The AT port of a SIM8202G is interface 2, for which the kernel says 02.
    assert rule.endswith('SYMLINK+="slot/cellular-$attr{bInterfaceNumber}"')
    assert 'ATTRS{bInterfaceNumber}=="?*"' in rule


def test_a_slot_whose_place_is_not_known_has_no_name():
    assert "slot/" not in slot_names.rules({"name": "other", "slots": {"somewhere": {"title": "a module"}}})


def test_a_board_without_slots_has_no_rules():
    assert slot_names.rules({"name": "none"}).count("\n") == 1
