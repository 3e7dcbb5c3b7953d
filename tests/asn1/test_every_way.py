"""Made values of every message through every way in and out of the library: all say the same."""

import re
from collections.abc import Iterator
from typing import Any

import pytest

from tests.asn1.codec import captain_messages
from tests.asn1.reach import pruned
from tests.asn1.truth import schema
from tests.asn1.validity import Validity
from tests.asn1.values import Values

MESSAGES = sorted(schema().messages)


def made(name: str, count: int, knows_more: bool = True) -> Iterator[Any]:
    pdu = schema().messages[name].pdu
    values = Values(pruned(schema(), pdu), pdu, 7, knows_more, is_long=False)
    for _ in range(count):
        value = values.value()
        values.complete()
        yield value


@pytest.mark.parametrize("name", MESSAGES)
def test_a_view_holds_what_decoding_gives_and_encodes_to_the_same_octets(name: str):
    message = captain_messages.find(name)
    for value in made(name, 80):
        octets = message.encode(value)
        assert message.view(octets).to_dict() == value
        assert message.encode(message.view(octets)) == octets


@pytest.mark.parametrize("name", MESSAGES)
def test_json_comes_back_as_the_same_octets(name: str):
    message = captain_messages.find(name)
    for value in made(name, 200):
        octets = message.encode(value)
        for plain in (False, True):
            assert message.from_json(message.to_json(octets, plain=plain), plain=plain) == octets


def test_an_object_identifier_of_any_size_is_text_everywhere():
    ivim = captain_messages.find("ivim-2.2.1")
    texts = (ivim.to_json(ivim.encode(value)) for value in made(ivim.name, 100))
    text = next(text for text in texts if '"baseOid"' in text)
    huge = "[" + "FF" * 300 + "7F]"  # one number of 2107 bits
    for written, base in (("1.2", "1.2"), ("8571", "8571"), (huge, huge), ("[02]", "2")):
        octets = ivim.from_json(re.sub(r'"baseOid":"[^"]*"', f'"baseOid":"{written}"', text))
        value = ivim.decode(octets)
        assert f"'baseOid': '{base}'" in repr(value)
        assert ivim.encode(value) == octets
        assert ivim.encode(_with_base(value, written)) == octets
    for wrong in ("", "[", "[]", "[F]", "[80]", "[FF]", "1.", ".1", "1.02", "1\0", "1.2\0]", "x", "\ud800"):
        with pytest.raises(captain_messages.EncodeError):
            ivim.encode(_with_base(value, wrong))


def _with_base(value: Any, base: str) -> Any:
    """The value with another baseOid wherever it has one."""
    match value:
        case dict():
            return {name: base if name == "baseOid" else _with_base(one, base) for name, one in value.items()}
        case list() | tuple():
            return type(value)(_with_base(one, base) for one in value)
    return value


@pytest.mark.parametrize("name", MESSAGES)
def test_an_explanation_accounts_for_every_bit_once(name: str):
    message = captain_messages.find(name)
    for value in made(name, 40):
        octets = message.encode(value)
        steps = [step for step in message.explain(octets) if step.width and step.what not in {"enter", "leave"}]
        assert [step.bit for step in steps] + [8 * len(octets)] == [0] + [step.bit + step.width for step in steps]


@pytest.mark.parametrize("name", MESSAGES)
def test_a_value_is_valid_where_it_keeps_to_every_constraint_and_nowhere_else(name: str):
    row = schema().messages[name]
    validity = Validity(schema())
    for number, value in enumerate(made(name, 100, knows_more=False)):
        if row.ids and number % 8:  # or hardly a value would get past its header
            key = "messageID" if "messageID" in value["header"] else "messageId"
            value["header"] |= {"protocolVersion": row.versions[-1], key: row.ids[number % len(row.ids)]}
        assert is_valid(name, value) == validity.is_valid(row.pdu, value), value


def is_valid(name: str, value: Any) -> bool:
    try:
        captain_messages.find(name).validate(value)
    except captain_messages.ValidateError:
        return False
    return True


def test_values_of_both_kinds_are_among_them():
    seen = {
        name: {is_valid(name, value) for value in made(name, 200, knows_more=False)}
        for name in ("ivim-2.1.1", "cpm-tr-2.1.1")
    }
    assert set(map(frozenset, seen.values())) == {frozenset({True, False})}
