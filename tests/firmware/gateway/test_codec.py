"""Editions of messages: what is said of wrong ones, what is kept beside, which edition octets are."""

from types import SimpleNamespace

import pytest

from firmware.gateway.captain_gateway.captain_gateway.codec import (
    KEPT_OF_A_STATION,
    KEPT_STATIONS,
    MOST_TRIED,
    Edition,
    Kept,
    load,
)
from firmware.gateway.captain_gateway.captain_gateway.errors import GatewayError, RefusedError
from firmware.gateway.captain_gateway.captain_gateway.handlers import KINDS
from firmware.gateway.captain_gateway.captain_gateway.routing import Routing
from tests.firmware.gateway.library import HEAD, Library, Message, Partial
from tests.firmware.gateway.real import CAM, DENM, real


def edition(name: str = "cam-1.4.1", library: Library | None = None) -> Edition:
    return Edition(library or Library(), name, "etsi_its", KINDS[name.partition("-")[0]])


def test_a_message_library_that_knows_nothing_of_ros_is_refused_with_what_to_do():
    with pytest.raises(GatewayError, match="generated without --ros2; install its wheel: captain-asn1 generate"):
        load()


def test_an_edition_that_is_none_is_refused_with_those_that_there_are():
    with pytest.raises(GatewayError, match=r"cam.edition: .*cam-9"):
        edition("cam-9.9.9")


def test_an_edition_that_the_profile_cannot_say_is_refused():
    with pytest.raises(GatewayError, match="in the profile v2x_msgs"):
        Edition(Library(), "cam-1.4.1", "v2x_msgs", KINDS["cam"])


def test_a_message_goes_to_ros_and_back():
    made = edition().to_cdr(CAM)
    assert made == (HEAD + CAM, ())
    assert edition().from_cdr(made.cdr) == CAM


def test_octets_that_are_no_message_of_the_type_are_told_from_values_out_of_range():
    with pytest.raises(RefusedError) as foreign:
        edition().from_cdr(b"\0\0" + CAM)
    with pytest.raises(RefusedError, match="cam") as wrong:
        edition().from_cdr(HEAD + CAM[:30])
    assert (foreign.value.cause, wrong.value.cause) == ("foreign", "out-of-range")


def test_a_message_that_does_not_decode_is_refused_with_the_place():
    with pytest.raises(RefusedError, match="bit 227: truncated") as refused:
        edition().to_cdr(CAM[:30])
    assert refused.value.cause == "undecodable"


def test_what_has_no_field_is_kept_and_is_sent_again_with_the_same_message():
    one = edition(library=Library(Partial))
    made = one.to_cdr(CAM)
    assert made.left_out == ("cam.[3]",)
    assert one.from_cdr(made.cdr) == CAM
    changed = made.cdr[:-1] + bytes([made.cdr[-1] ^ 1])
    assert one.from_cdr(changed)[6] == 0  # another message: it is sent as ROS says it


class Choosy(Partial):
    """What it kept back cannot be said without the original."""

    tried = 0

    def from_cdr(self, cdr: bytes, profile: str, original: bytes | None = None) -> bytes:
        type(self).tried += original is not None
        if cdr[:4] != HEAD or original is None:
            return Message.from_cdr(self, b"" if cdr[:4] != HEAD else HEAD + CAM[:30], profile)
        return super().from_cdr(cdr, profile, original)


def test_a_message_that_cannot_be_said_without_its_original_finds_it():
    one = edition(library=Library(Choosy))
    assert one.from_cdr(one.to_cdr(CAM).cdr) == CAM


@pytest.mark.parametrize(("cdr", "tried"), [(b"\0\0" + CAM, 0), (HEAD + CAM, MOST_TRIED)])
def test_a_wrong_message_is_compared_with_a_few_originals_and_foreign_octets_with_none(cdr, tried, monkeypatch):
    monkeypatch.setattr(Choosy, "tried", 0)
    one = edition(library=Library(Choosy))
    for station in range(100):
        one.to_cdr(CAM[:2] + station.to_bytes(4, "big") + CAM[6:])
    for number in range(9):
        one.to_cdr(CAM[:-1] + bytes([number]))
    with pytest.raises(RefusedError):
        one.from_cdr(cdr)
    assert Choosy.tried == tried


def test_what_has_no_field_is_not_given_to_another_station():
    one = edition(library=Library(Partial))
    made = one.to_cdr(CAM)
    other = made.cdr[:6] + b"\0\0\5\x39" + made.cdr[10:]
    assert one.from_cdr(other)[6] == 0


def test_no_more_originals_are_kept_than_of_so_many_stations():
    kept = Kept()
    for number in range(KEPT_STATIONS + 1):
        kept.keep(b"\2\2" + number.to_bytes(4, "big") + b"x")
    assert kept.of(b"\2\2\0\0\0\0") == []
    assert kept.of(b"\2\2\0\0\0\1") == [b"\2\2\0\0\0\1x"]
    for number in range(KEPT_OF_A_STATION + 1):
        kept.keep(b"\2\2\0\0\0\1" + bytes([number]))
    assert kept.of(b"\2\2\0\0\0\1")[0][-1:] == bytes([KEPT_OF_A_STATION])
    assert len(kept.of(b"\2\2\0\0\0\1")) == KEPT_OF_A_STATION


def test_an_original_that_comes_again_is_kept_once():
    kept = Kept()
    for _ in range(3):
        kept.keep(CAM)
    assert kept.of(CAM) == [CAM] == kept.newest()


@pytest.mark.parametrize(
    ("pdu", "words"),
    [
        (b"\2\1" + CAM[2:], "header.message_id: 1 is not that of cam: 2"),
        (b"\7\2" + CAM[2:], "header.protocol_version: 7 is not that of cam-1.4.1: 2"),
        (b"", "0 octets are too short; the header alone has 6"),
        (CAM[:5], "5 octets are too short"),
        (CAM + bytes(1400), "1560 octets; a station takes 1500"),
    ],
)
def test_what_a_station_would_take_for_something_else_is_not_sent(pdu, words):
    with pytest.raises(RefusedError) as refused:
        edition().check(pdu)
    assert words in str(refused.value)


def test_a_real_message_may_be_sent():
    edition().check(CAM)
    edition("denm-1.3.1").check(DENM)


def one(name: str) -> SimpleNamespace:
    return SimpleNamespace(name=name, edition=edition(name))


def test_an_edition_of_another_type_is_refused():
    with pytest.raises(GatewayError, match=r"cam\.edition: denm-1\.3\.1 is not an edition of cam"):
        Edition(Library(), "denm-1.3.1", "etsi_its", KINDS["cam"])


class Both(Message):
    """A library where each form gives the octets of the other back, and `loose` breaks a constraint in them."""

    loose = ""

    def encode(self, value: object) -> bytes:
        return CPM

    def view(self, octets: bytes) -> bytes:
        return octets

    def validate(self, value: object) -> None:
        if self.name == self.loose:
            raise ValueError("it breaks a constraint")


CPM = b"\2\x0e" + bytes(40)


@pytest.mark.parametrize("loose", ["cpm-2.1.1", "cpm-2.1.1-ext"])
@pytest.mark.parametrize("handler", ["cpm-2.1.1", "cpm-2.1.1-ext"])
def test_of_two_interpretations_the_one_that_keeps_every_constraint_is_published(handler, loose, monkeypatch):
    monkeypatch.setattr(Both, "loose", loose)
    valid = "cpm-2.1.1-ext" if loose == "cpm-2.1.1" else "cpm-2.1.1"
    assert edition(handler, Library(Both)).of(CPM).name == valid


def test_of_two_interpretations_that_keep_every_constraint_that_of_the_handler_is_published():
    assert edition("cpm-2.1.1-ext", Library(Both)).of(CPM).name == "cpm-2.1.1-ext"


def test_a_message_is_for_the_handler_of_its_number():
    routing = Routing([one("cam-1.4.1"), one("denm-1.3.1")])
    assert routing.find(CAM).name == "cam-1.4.1"
    assert routing.find(DENM).name == "denm-1.3.1"
    assert routing.find(b"\2\7" + bytes(9)) is None


def test_between_editions_protocol_version_decides():
    routing = Routing(
        [
            one("cpm-2.1.1"),
            SimpleNamespace(name="tr", edition=Edition(Library(), "cpm-tr-2.1.1", "etsi_its", KINDS["cpm_tr"])),
        ]
    )
    assert routing.find(real("cpm", 624)).name == "tr"


def test_between_editions_of_one_version_the_first_that_gives_the_same_octets_back_has_it():
    routing = Routing([one("cam-1.4.1"), one("cam-2.1.1")])
    assert routing.find(CAM).name == "cam-1.4.1"
    assert Routing([one("cam-2.1.1"), one("cam-1.4.1")]).find(CAM).name == "cam-2.1.1"


def test_the_interpretation_that_decided_between_handlers_is_found_once():
    handlers = [one("denm-1.3.1"), one("denm-2.2.1")]
    handler, found = Routing(handlers).find_edition(DENM)
    assert handler is handlers[0]
    assert found is handler.edition
    assert Routing(handlers[:1]).find_edition(DENM) == (handlers[0], None)


def test_what_no_edition_decodes_goes_to_the_first_which_says_why():
    routing = Routing([one("cam-1.4.1"), one("cam-2.1.1")])
    assert routing.find(CAM[:30]).name == "cam-1.4.1"
