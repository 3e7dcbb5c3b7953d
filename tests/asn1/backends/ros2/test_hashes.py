"""Profile etsi_its against etsi_its_messages 3.5.0: the hash of every type of every package that it has.

etsi_its_messages.json: hashes of the released definitions (MIT licence), computed by rosbags.
"""

import json
from pathlib import Path

import pytest

from asn1.backends.ros2 import profile_etsi_its
from asn1.backends.ros2.rihs import hash_of
from asn1.model.text import load_schema

DOCUMENT = Path(__file__).resolve().parents[4] / "asn1" / "backends" / "ros2" / "HASHES.md"
UPSTREAM = json.loads(Path(__file__).with_name("etsi_its_messages.json").read_text(encoding="utf-8"))["packages"]
SCHEMA = load_schema()


@pytest.mark.parametrize("edition", profile_etsi_its.PACKAGES)
def test_every_type_is_that_of_etsi_its_messages(edition):
    package = profile_etsi_its.package(SCHEMA, SCHEMA.messages[edition])
    ours = {name: hash_of(package, name).removeprefix("RIHS01_") for name in package.messages}
    assert ours == UPSTREAM[package.name]


def test_only_the_message_of_a_research_project_is_not_made():
    made = set(profile_etsi_its.PACKAGES.values())
    assert set(UPSTREAM) - made == {"etsi_its_mcm_uulm_msgs"}
    assert sum(len(UPSTREAM[name]) for name in made) == 1114


def test_the_document_says_what_is_made():
    """What rosbags and ROS's own generator say of it is compared by `make ros2`."""
    text = DOCUMENT.read_text(encoding="utf-8")
    for edition in profile_etsi_its.PACKAGES:
        package = profile_etsi_its.package(SCHEMA, SCHEMA.messages[edition])
        section = text.partition(f"\n## {package.name}\n")[2].partition("\n## ")[0]
        rows = [line.split(" | ")[:2] for line in section.splitlines() if " | equal | equal | equal |" in line]
        ours = {name: hash_of(package, name).removeprefix("RIHS01_") for name in package.messages}
        assert {name.removeprefix("| "): digits for name, digits in rows} == ours
