"""Selection of messages by the words of a command line."""

import dataclasses

import pytest

from asn1.model import selection
from asn1.model.types import Message, Schema
from tests.asn1.example import here, schema


def message(name: str, rank: int, is_experimental: bool = False) -> Message:
    type_ = name.partition("-")[0]
    return Message(name, type_, 1, "Demo TS 1", here("Demo"), (), (), 0, rank, is_experimental)


MESSAGES = (message("cam-2.3.1", 1), message("cam-1.4.1", 0), message("cpm-2.1.1", 0), message("mine", 0, True))
SCHEMA = dataclasses.replace(schema(), messages={one.name: one for one in MESSAGES})


@pytest.mark.parametrize(
    ("words", "names"),
    [
        (["cam-2.3.1"], ["cam-2.3.1"]),
        (["cam"], ["cam-1.4.1"]),
        (["CAM"], ["cam-1.4.1"]),
        (["cam-*"], ["cam-2.3.1", "cam-1.4.1"]),
        (["cpm", "cam-2.3.1"], ["cam-2.3.1", "cpm-2.1.1"]),
        (["cam", "cam-1.4.1"], ["cam-1.4.1"]),
    ],
)
def test_a_word_is_a_name_a_type_or_a_pattern(words: list[str], names: list[str]):
    assert selection.named(SCHEMA, words) == tuple(names)


@pytest.mark.parametrize(("word", "hint"), [("cma", "did you mean .*cam"), ("cam-2.3", "cam-2.3.1"), ("zzzz", "list")])
def test_a_word_that_names_nothing_gets_what_is_alike(word: str, hint: str):
    with pytest.raises(selection.UnknownMessageError, match=hint):
        selection.named(SCHEMA, [word])


def test_the_standard_set_leaves_experimental_messages_out():
    assert selection.standard(SCHEMA) == ("cam-2.3.1", "cam-1.4.1", "cpm-2.1.1")


def test_a_part_holds_the_modules_that_its_messages_reach_and_no_others():
    spare = dataclasses.replace(SCHEMA.modules["r9_demo"], key="r9_other")
    part = selection.part(Schema({**SCHEMA.modules, "r9_other": spare}, SCHEMA.messages), ["cam-1.4.1"])
    assert set(part.modules) == {"r9_demo"}
    assert set(part.messages) == {"cam-1.4.1"}
