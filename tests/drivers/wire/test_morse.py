"""Morse code: encoding, decoding from durations, CRC."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.reason import Reason
from drivers.wire.morse import (
    DIGITS,
    END,
    LETTERS,
    MAX_PDU,
    MOST_DURATIONS,
    START,
    ToneDecoder,
    decode,
    encode,
    wav,
)

CAM = bytes.fromhex("0202000005390001020304")

HEADER = b"".join(wav([], 0))
pdus = st.binary(max_size=60)


def spoken(durations, unit):
    return b"".join(wav(durations, unit))


def heard(octets, *cuts):
    """Return the durations in a sound file that is read in slices."""
    ear = ToneDecoder()
    for start, end in pairwise([0, *cuts, len(octets)]):
        ear.receive(octets[start:end])
    return ear.end()


def written(durations):
    """Return durations in the written form of Morse code, as dots, dashes and spaces."""
    signs = zip(durations[::2], [*durations[1::2], 0], strict=True)
    return "".join("..-"[long - 1] + (" " if gap == 3 else "") for long, gap in signs)


def test_an_octet_is_two_digits_and_a_checksum_between_start_and_end():
    message = written(encode(b"\x2a")).split()
    assert message[:3] == [START, DIGITS["2"], DIGITS["A"]]
    assert message[-1] == END
    assert len(message) == 8


def test_the_checksum_is_crc_16_xmodem():
    # The check value of the catalogue of CRC algorithms: "123456789" gives 31C3.
    digits = "".join(LETTERS[code] for code in written(encode(b"123456789")).split()[1:-1])
    assert digits == b"123456789".hex().upper() + "31C3"


def test_a_message_begins_and_ends_with_sound():
    assert len(encode(b"")) % 2 == 1


@given(pdu=pdus)
def test_what_was_encoded_is_decoded(pdu):
    assert decode(encode(pdu)) == pdu


@given(pdu=pdus, unit=st.floats(0.001, 1000), data=st.data())
def test_an_unsteady_hand_is_understood(pdu, unit, data):
    durations = encode(pdu)
    wobble = data.draw(st.lists(st.floats(0.8, 1.2), min_size=len(durations), max_size=len(durations)))
    assert decode([units * unit * error for units, error in zip(durations, wobble, strict=True)]) == pdu


@given(pdu=pdus, unit=st.integers(5, 30))
def test_what_was_spoken_is_heard(pdu, unit):
    assert decode(heard(spoken(encode(pdu), unit))) == pdu


@given(pdu=st.binary(max_size=8), size=st.integers(100, 5000))
def test_what_is_heard_does_not_depend_on_how_the_file_is_cut(pdu, size):
    file = spoken(encode(pdu), 5)
    assert heard(file, *range(size, len(file), size)) == heard(file)
    assert decode(heard(file)) == pdu


@given(pdu=st.binary(max_size=8), noise=st.binary(min_size=100, max_size=1000))
def test_a_little_noise_does_not_matter(pdu, noise):
    samples = bytearray(spoken(encode(pdu), 20))
    for place, value in enumerate(noise):
        at = 44 + place * (len(samples) - 44) // len(noise)
        samples[at] = min(255, max(0, samples[at] + value % 32 - 16))
    assert decode(heard(bytes(samples))) == pdu


@given(pdu=pdus, place=st.integers(0))
def test_one_wrong_duration_is_noticed(pdu, place):
    durations = encode(pdu)
    place %= len(durations)
    durations[place] = 4 - durations[place]  # a dot for a dash, a gap between letters for one inside
    assert decode(durations) in (Reason.FRAMING, Reason.CHECKSUM)


def test_a_wrong_digit_is_a_wrong_checksum():
    durations, five, four = encode(b"\x55"), [1] * 9, [1] * 8 + [3]
    assert durations[10:19] == five
    assert decode(durations[:10] + four + durations[19:]) == Reason.CHECKSUM


@pytest.mark.parametrize("durations", [[], [1], [1, 1], [3, 1, 1, 1, 3, 1, 1, 1, 3], [0] * 30, [1] * 1000])
def test_what_is_no_message_is_a_framing_error(durations):
    assert decode(durations) is Reason.FRAMING


@given(durations=st.lists(st.floats(0, 1e6) | st.integers(0, 9), max_size=200))
def test_random_durations_are_refused(durations):
    assert isinstance(decode(durations), Reason)


@given(samples=st.binary(max_size=20_000))
def test_random_samples_are_refused(samples):
    assert isinstance(decode(heard(HEADER + samples)), Reason)


@given(octets=st.binary(max_size=200), place=st.integers(0), value=st.integers(0, 255))
def test_a_damaged_wav_file_is_read_or_silent(octets, place, value):
    file = bytearray(spoken([1, 1, 3], 5))
    file[place % 60] = value
    assert isinstance(heard(bytes(file)), list)
    assert heard(octets) == []


def test_endless_noise_is_not_listened_to_for_ever():
    assert len(heard(HEADER + (b"\xff" + bytes([128]) * 40) * 30_000)) <= MOST_DURATIONS + 1


def test_the_longest_pdu_fits_what_is_listened_to():
    longest = bytes(MAX_PDU)  # the digit 0 has five signs, no digit has more
    assert len(encode(longest)) <= MOST_DURATIONS
