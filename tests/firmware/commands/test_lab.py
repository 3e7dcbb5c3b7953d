"""captain lab: the verdict on what tshark decodes of a capture. tests/system/test_lab.py runs the command."""

import pytest

from firmware.commands.lab import Result
from firmware.lab.copies import Count
from firmware.lab.dissection import Dissected
from firmware.lab.laboratory import vectors

# One copy of each message, as Wireshark 4.0 decodes it: no MAPEM of protocolVersion 9, and no VAM.
WIRESHARK_4_0 = {
    2001: (4, 4, 0),
    2002: (2, 2, 0),
    2003: (2, 1, 1),
    2004: (1, 1, 0),
    2006: (1, 1, 0),
    2009: (1, 1, 0),
    2018: (1, 0, 1),
}


def is_good(malformed: int = 0, **other: tuple[int, int, int]) -> bool:
    """The verdict where the rows of other ports, as port_2018, are (frames, decoded, btp)."""
    count = Count(vectors(), "A")
    for place in range(len(count.vectors)):
        count.sent("A", place)
    ports = WIRESHARK_4_0 | {int(port.removeprefix("port_")): row for port, row in other.items()}
    rows = [Dissected(port, *row, malformed * (port == 2001)) for port, row in ports.items()]
    return Result(count, rows, is_decoded=True).is_well_formed


def test_a_message_beside_the_ten_that_tshark_does_not_know_is_no_failure():
    assert is_good()


def test_a_message_beside_the_ten_that_tshark_knows_is_no_failure():
    # Wireshark 4.4 decodes the VAM.
    assert is_good(port_2018=(1, 1, 0))


@pytest.mark.parametrize(
    "other",
    [
        {"port_2001": (4, 3, 1)},
        {"port_2001": (4, 3, 1), "port_2018": (1, 1, 0)},  # as many as before, but of the ten
        {"port_2003": (2, 0, 2)},
        {"port_2004": (0, 0, 0)},
    ],
)
def test_a_message_of_the_ten_that_is_not_decoded_or_not_there_is_a_failure(other: dict[str, tuple[int, int, int]]):
    assert not is_good(**other)


def test_a_malformed_frame_is_a_failure():
    assert not is_good(malformed=1)
