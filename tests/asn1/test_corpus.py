"""The committed corpus of the fuzzer, without clang: every input is taken, or refused with a place and a reason."""

from pathlib import Path

import captain_messages as messages
import pytest

from tests.fuzz import corpus

TARGETS = sorted(path.stem for path in corpus.COMMITTED.glob("*.hex"))


def test_every_message_has_a_corpus():
    assert {message.name for message in messages.all() if not message.is_experimental} <= set(TARGETS)


@pytest.mark.parametrize("target", TARGETS)
def test_an_input_is_taken_and_comes_back_or_is_refused_with_a_place(target: str):
    message = messages.find(target)
    for octets in corpus.read(target):
        try:
            value = message.decode(octets)
        except messages.DecodeError as error:
            assert octets not in corpus.seeds(target)
            assert 0 <= error.bit <= 8 * len(octets)
            assert error.reason
            continue
        assert message.decode(message.encode(value)) == value
        assert message.decode(message.from_json(message.to_json(octets))) == value
        assert message.text(octets)


def test_what_fuzzing_finds_is_kept_below_the_messages_that_stay(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(corpus, "COMMITTED", tmp_path)
    real = bytes(corpus.MAX_OCTETS + 1)
    (tmp_path / "t.hex").write_text(f"{real.hex()}\n\nff\n")
    assert corpus.write("t", [real, *(bytes([number]) for number in range(200))]) == corpus.MAX_INPUTS
    assert corpus.seeds("t") == [real]
    assert corpus.read("t")[:2] == [real, b"\0"]
    assert corpus.unpack("t", tmp_path / "files") == corpus.MAX_INPUTS + 1


def test_a_target_without_a_corpus_begins_with_nothing(tmp_path: Path):
    assert corpus.unpack("no such target", tmp_path) == 0
