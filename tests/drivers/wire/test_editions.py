"""Editions that fit a PDU, compared by the values that they read."""

from dataclasses import replace

import captain_messages
import pytest

from drivers.wire.editions import NAMES, compared
from firmware.gateway.captain_gateway.captain_gateway.codec import Edition
from firmware.gateway.captain_gateway.captain_gateway.handlers import KINDS
from tests.firmware.codec.standin import Message, octets
from tests.firmware.gateway import library


class Readable(Message):
    """Message with the additional attributes that the gateway uses."""

    pdu = "CAM"

    def reader(self, *paths: str) -> object:
        raise ValueError(f"no path {paths}")


class Unreadable(Readable):
    def leaves(self, octets: bytes) -> tuple[bytes, int]:
        raise MemoryError


class Gateways(library.Library):
    """Message library of the gateway, with only these messages."""

    def __init__(self, *messages: Readable) -> None:
        super().__init__()
        self._messages = tuple(map(library.Message, messages))

    def find(self, name: str) -> library.Message:
        return next(one for one in self._messages if one.name == name)

    def all(self) -> tuple[library.Message, ...]:
        return self._messages


FIRST = Readable("cam-1.4.1", ids=(2,), versions=(2,), fields={"size": 200})
OTHER = replace(FIRST, name="cam-2.1.1", rank=2, offset=1)  # reads other values
UNREADABLE = Unreadable("cam-2.3.1", ids=(2,), versions=(2,), fields={"size": 200})
PDU = octets(FIRST, 7, number=2)


def others(*messages: Readable) -> list[str]:
    """Return the further editions that fit; check that station and gateway agree."""
    ordered, found = compared(messages, PDU)
    handler = Edition(Gateways(*messages), ordered[0].name, "etsi_its", KINDS["cam"])
    assert handler.others(PDU) == tuple(one.name for one in found)
    return [one.name for one in found]


def test_an_edition_that_reads_other_values_is_named():
    assert others(FIRST, OTHER) == ["cam-2.1.1"]


def test_an_edition_that_knows_less_is_not_named():
    assert others(FIRST, replace(OTHER, unknown=1)) == []


def test_an_edition_that_knows_less_is_not_named_either_where_no_edition_knows_all():
    assert others(replace(FIRST, unknown=1), replace(OTHER, unknown=2)) == []
    assert others(replace(FIRST, unknown=1), replace(OTHER, unknown=1)) == ["cam-2.1.1"]


@pytest.mark.parametrize("unknown", [0, 1, 99])
def test_an_edition_that_cannot_be_read_comes_last_and_is_named(unknown: int):
    assert others(UNREADABLE, replace(FIRST, unknown=unknown)) == ["cam-2.3.1"]


def test_editions_that_cannot_be_read_are_named():
    assert others(UNREADABLE, replace(UNREADABLE, name="cam-2.1.1")) == ["cam-2.1.1"]


def test_names_of_editions_are_those_of_the_message_library():
    assert sorted(NAMES) == sorted(message.name for message in captain_messages.all() if message.ids)
