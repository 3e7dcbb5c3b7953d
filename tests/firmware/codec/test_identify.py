import pytest
from hypothesis import given
from hypothesis import strategies as st

from firmware.codec.identify import Identifier, Identity, Unknown
from tests.firmware.codec.standin import BARE, DOOR, NEW, OLD, SAME, Message, octets
from tests.said import tells

EXACT = "it gives the same octets back"  # of an edition whose encoding has the octets that were decoded
ALL = [OLD, NEW, SAME, DOOR, BARE]


def identity(pdu: bytes, known: list[Message] = ALL, port: int | None = None, is_asked: bool = False) -> Identity:
    found = Identifier(known, is_asked).identify(pdu, port)
    assert isinstance(found, Identity)
    return found


def unknown(pdu: bytes, known: list[Message] = ALL, port: int | None = None) -> Unknown:
    found = Identifier(known).identify(pdu, port)
    assert isinstance(found, Unknown)
    return found


def test_message_by_its_header_is_of_the_edition_that_a_trial_gives():
    found = identity(octets(NEW, 5, 1))
    assert found.message is NEW
    assert found.why.startswith("messageID 66 and protocolVersion 2 announce it; ")
    assert found.why.endswith(f"; {EXACT}")


def test_message_of_several_exact_editions_is_of_the_smallest_rank_and_names_all():
    found = identity(octets(OLD, 7, version=2))
    assert found.message is SAME
    assert found.exact == (SAME, OLD)
    assert tells(found.why, EXACT, " ball-1.1")


def test_an_edition_of_the_announced_version_comes_before_one_of_smaller_rank():
    assert identity(octets(OLD, 7, version=1)).message is OLD


def test_an_edition_that_is_passed_over_is_named_with_the_reason():
    found = identity(octets(NEW, 5, 1))
    assert found.message is NEW
    assert "ball-1.2 does not decode (the message: bit 56: 1 octets follow)" in found.why


def test_octets_that_an_edition_of_another_version_takes_are_not_shown_as_that():
    found = unknown(octets(OLD, 150, version=1))
    assert found.nearest is not None
    assert str(found.nearest) == "body.size: bit 48: out of range: 150 is not in 0..100"
    assert found.nearest.message is OLD


def test_message_of_an_unknown_version_is_decoded_and_doubted():
    found = identity(octets(OLD, 7, version=9))
    assert found.message is SAME
    assert tells(found.why, "messageID 66 ", "but protocolVersion 9 ")
    assert tells(found.doubt, "no edition", "ball", "protocolVersion 9")


OTHER = Message("ball-3.1", ids=(66,), versions=(2,), fields={"size": 200}, rank=5, offset=1)


def test_editions_that_read_the_same_values_are_not_doubted():
    found = identity(octets(OLD, 7, version=2))
    assert (found.exact, found.others, found.doubt) == ((SAME, OLD), (), "")


def test_an_edition_that_reads_other_values_is_named():
    found = identity(octets(OLD, 7, version=2), [*ALL, OTHER])
    assert found.message is SAME
    assert found.others == (OTHER,)
    assert found.doubt == "ball-3.1 also decodes it, to different values"


def test_edition_that_knows_every_part_comes_before_one_of_smaller_rank_that_does_not():
    partial = Message("ball-0.9", ids=(66,), versions=(2,), fields={"size": 200}, rank=0, offset=1, unknown=1)
    for is_quick in (False, True):
        found = Identifier([partial, SAME]).identify(octets(SAME, 7), is_quick=is_quick)
        assert isinstance(found, Identity)
        assert (found.message, found.doubt) == (SAME, "")
    assert tells(identity(octets(SAME, 7), [partial, SAME]).why, "ball-0.9 ", "extensions undecoded")


def test_edition_that_gives_other_octets_back_comes_after_one_that_gives_the_same():
    lossy = Message("ball-9", ids=(66,), versions=(2,), fields={"size": 200}, rank=0, mask=0x0F)
    found = identity(octets(SAME, 0x33), [lossy, SAME])
    assert found.message is SAME
    assert found.exact == (SAME,)
    assert tells(found.why, "ball-9 ", "other octets")


def test_message_that_is_encoded_otherwise_is_decoded_and_reported_as_inexact():
    lossy = Message("ball-9", ids=(66,), versions=(2,), fields={"size": 200}, mask=0x0F)
    found = identity(octets(lossy, 0x33), [lossy])
    assert not found.is_exact
    assert found.why.endswith("other octets")
    assert EXACT not in found.why


def test_edition_that_is_asked_for_decides_whatever_the_header_says():
    found = identity(octets(DOOR, 1, number=5), [OLD], is_asked=True)
    assert found.message is OLD
    assert tells(found.why, "asked for", f"; {EXACT}")


def test_message_whose_header_is_of_another_edition_than_asked_for_is_refused():
    found = Identifier([NEW], True, ALL).identify(octets(OLD, 7, version=1))
    assert isinstance(found, Unknown)
    assert tells(found.why, "header: messageID 66 ", "protocolVersion 1 ", "ball-1.1", "--edition is ball-2.1")
    assert tells(found.remedy, "ball-1.1", "--force")


def test_the_header_selects_among_the_editions_that_were_asked_for():
    late = Message("ball-0.1", ids=(66,), versions=(3,), fields={"size": 200}, rank=0)
    assert identity(octets(OLD, 7, version=1), [late, OLD], is_asked=True).message is OLD


def test_with_force_the_header_has_no_say():
    found = Identifier([SAME], True, ALL, is_forced=True).identify(octets(OLD, 7, version=1))
    assert isinstance(found, Identity)
    assert (found.message, found.doubt) == (SAME, "")


def test_the_port_says_it_where_the_header_announces_nothing():
    found = identity(octets(DOOR, 1, 2, 3, number=99), port=3002)
    assert found.message is DOOR
    assert found.why.startswith("BTP port 3002 carries it, though messageID is 99")


def test_the_port_says_it_where_what_the_header_announces_does_not_decode():
    assert identity(octets(DOOR, 1, 2, 3, number=66), port=3002).message is DOOR


def test_the_port_is_only_a_guess_where_the_header_announces_another():
    lossy = Message("ball-9", ids=(66,), versions=(2,), fields={"size": 200}, mask=0x0F, btp_port=3001)
    assert unknown(octets(DOOR, 0x33), [lossy, DOOR], port=3001).nearest.message is DOOR


def test_message_by_the_port_of_another_type_gives_that_type():
    assert tells(identity(octets(DOOR, 1, 2, 3), port=3001).why, "; BTP port 3001 ", "ball")
    assert "port" not in identity(octets(DOOR, 1, 2, 3), port=3002).why
    assert "port" not in identity(octets(DOOR, 1, 2, 3), port=9).why


def test_vam_of_the_legacy_number_is_identified():
    vam = Message("vam-2", ids=(16,), versions=(2,), fields={"a": 9})
    found = identity(octets(vam, 1, number=102), [vam])
    assert tells(found.why, "messageID 102 ", "VAM", "legacy")


def test_message_of_an_unknown_number_is_a_guess():
    found = identity(octets(DOOR, 1, 2, 3, number=99))
    assert tells(found.why, "guess", "messageID 99; ", EXACT)


def test_a_message_without_header_is_found_by_trial():
    assert identity(bytes((66, 99, 0, 0, 0, 0, 1, 1))).message is BARE


def test_a_guess_has_to_keep_every_constraint():
    assert unknown(bytes((66, 66, 0, 0, 0, 0, 200, 200))).nearest is not None


class Hungry(Message):
    def validate(self, value: object) -> None:
        raise MemoryError


def test_a_guess_whose_constraints_ask_for_too_much_memory_is_not_taken():
    hungry = Hungry("ball-9", ids=(66,), versions=(2,), fields={"size": 200})
    assert unknown(octets(hungry, 3, number=99), [hungry]).nearest is None


def test_a_guess_has_to_give_the_same_octets_back():
    lossy = Message("ball-9", ids=(66,), versions=(2,), fields={"size": 200}, mask=0x0F)
    assert unknown(octets(lossy, 0x33, number=99), [lossy]).nearest is None


def test_a_type_that_is_announced_and_does_not_decode_is_not_guessed_to_be_another():
    found = unknown(octets(OLD, 1, 2, 3))
    assert found.nearest is not None
    assert found.nearest.message in (OLD, NEW, SAME)


def test_of_messages_that_do_not_decode_the_one_that_came_farthest_is_told():
    nearest = unknown(octets(NEW, 5, 7, 9)).nearest
    assert nearest is not None
    assert (nearest.message, nearest.bit) == (NEW, 64)


@pytest.mark.parametrize("pdu", [b"", b"\x02", b"\x02\x42", bytes(6)])
def test_octets_too_short_for_any_message_are_unknown(pdu):
    assert unknown(pdu).why


def test_a_quick_look_stops_at_the_first_that_gives_the_same_octets_back():
    found = Identifier(ALL).identify(octets(OLD, 7, version=2), is_quick=True)
    assert isinstance(found, Identity)
    assert (found.message, found.exact) == (SAME, (SAME,))


@given(st.binary(max_size=12), st.none() | st.integers(0, 0xFFFF))
def test_any_octets_are_something_or_unknown(pdu, port):
    full, quick = (Identifier(ALL).identify(pdu, port, is_quick) for is_quick in (False, True))
    assert type(full) is type(quick)
    if isinstance(full, Identity) and isinstance(quick, Identity):
        assert full.message is quick.message


# Two forms of one message: the -ext form has a bound of its own, and counts from another value.
STRICT = Message("box-1", ids=(68,), versions=(2,), fields={"size": 100}, strict=50)
FORM = Message("box-1-ext", ids=(68,), versions=(2,), fields={"size": 200}, rank=2, form_of="box-1", offset=2)


def test_a_form_that_alone_decodes_is_taken_and_both_are_named():
    found = identity(octets(FORM, 150), [STRICT, FORM])
    assert (found.message, found.exact) == (FORM, (FORM,))
    assert "box-1 does not decode" in found.why
    found = identity(octets(STRICT, 30), [STRICT, Message("box-1-ext", (68,), (2,), {"size": 9}, 2, form_of="box-1")])
    assert found.message is STRICT
    assert found.why.endswith("the form box-1-ext (with extension bit) does not decode")


def test_message_of_two_forms_names_both_in_the_order_of_their_rank():
    found = identity(octets(STRICT, 30), [FORM, STRICT])
    assert found.exact == (STRICT, FORM)
    assert tells(found.why, EXACT, " box-1-ext")
    assert tells(found.doubt, "box-1-ext ", "different values")


@pytest.mark.parametrize("is_quick", [False, True])
def test_of_two_forms_that_fit_the_one_that_keeps_every_constraint_comes_first(is_quick: bool):
    found = Identifier([STRICT, FORM]).identify(octets(STRICT, 90), is_quick=is_quick)
    assert isinstance(found, Identity)
    assert found.exact == (FORM, STRICT)


def test_a_form_with_the_same_values_is_not_named():
    same = Message("box-1-ext", ids=(68,), versions=(2,), fields={"size": 100}, rank=2, form_of="box-1")
    assert identity(octets(STRICT, 30), [STRICT, same]).exact == (STRICT,)
