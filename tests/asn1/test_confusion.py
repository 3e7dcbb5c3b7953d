"""No PDU is silently shown as another edition's with other values; `make truth` tries 10,000 of each edition."""

from typing import Any

import pytest

from tests.asn1 import codec, confusion
from tests.asn1.truth import confusions, schema

MESSAGES = [one for one in schema().messages.values() if one.ids]
PDUS = 100


@pytest.fixture(scope="module")
def trial() -> confusion.Trial:
    return confusion.Trial(schema(), codec.captain_messages.all())


@pytest.mark.parametrize("name", [one.name for one in MESSAGES])
def test_pdus_of_an_edition_are_not_silently_shown_with_the_values_of_another(trial: confusion.Trial, name: str):
    found = trial.run(name, PDUS)
    assert (found.pdus, found.silent) == (PDUS, 0), found.examples


class Wide:
    """A message whose header is announced for every version: as cam-1.4.1 was for protocolVersion 1."""

    def __init__(self, message: Any) -> None:
        self._message = message
        self.versions = (1, *message.versions)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._message, name)

    def leaves(self, octets: bytes) -> tuple[bytes, int]:
        """Nothing tells it from others."""
        return b"", 0


def test_an_edition_that_takes_the_pdus_of_another_is_found_out():
    messages = [Wide(one) if one.name == "cam-1.4.1" else one for one in codec.captain_messages.all()]
    messages = [Wide(one) if one.name == "cam-1.3.2" else one for one in messages]
    found = confusion.Trial(schema(), messages).run("cam-1.3.2", 300)
    assert found.silent >= 5
    assert "cam-1.3.2: shown as cam-1.4.1" in found.examples[0]


def test_the_table_has_the_count_beside_its_goal():
    table = "\n".join(confusion.report({"cam-1.3.2": confusion.Confused(10, 1, 4, 3, 2, 1, ["cam-1.3.2: shown"])}))
    assert "cam-1.3.2" in table
    assert "with other values: 1 (goal: 0) MISSED" in table
    assert "silent: cam-1.3.2: shown" in table


def test_every_edition_with_a_header_is_tried():
    todo = confusions(MESSAGES, 2500)
    assert sum(one.values for one in todo if one.message == "cam-1.3.2") == 2500
    assert {one.message for one in todo} == {one.name for one in MESSAGES}
