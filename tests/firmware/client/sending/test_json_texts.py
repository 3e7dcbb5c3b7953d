import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from board.runtime.errors import RequestError
from firmware.client.sending.json_texts import Text, parse, split

VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=8,
)
OBJECTS = st.dictionaries(st.text(max_size=5), VALUES, max_size=3)


def lines(text: str) -> list[str]:
    return text.splitlines(keepends=True)


@given(st.lists(OBJECTS, max_size=4), st.sampled_from([None, 1, 2]))
def test_values_are_found_on_one_line_each_and_over_many(values, indent):
    text = "\n".join(json.dumps(value, indent=indent) for value in values)
    assert [parse(found.text, "here") for found in split(lines(text))] == values


def test_each_value_tells_the_line_where_it_begins():
    assert [found.line for found in split(lines('{}\n\n{\n "a": 1\n}\n0202\n'))] == [1, 3, 6]


def test_a_value_comes_as_soon_as_its_last_line_is_there():
    def endless():
        while True:
            yield '{"a":\n'
            yield "1}\n"

    found = split(endless())
    assert next(found) == next(found)._replace(line=1)


def test_a_broken_value_does_not_take_the_next_with_it():
    assert list(split(['{"a": [\n', '{"b": 1}\n'])) == [Text(1, '{"a": [\n'), Text(2, '{"b": 1}\n')]


def test_brackets_inside_strings_do_not_count():
    text = '{"a": "}]{[\\""}\n'
    assert list(split([text])) == [Text(1, text)]


def test_brackets_of_a_remark_do_not_count():
    assert [found.line for found in split(["# two [of them\n", "0202\n"])] == [1, 2]


def test_a_value_without_an_end_is_still_given():
    assert list(split(['{"a": 1\n'])) == [Text(1, '{"a": 1\n')]


@pytest.mark.parametrize("text", ['{"a": NaN}', "{", "[" * 100_000, '{"a": ' + "9" * 5000 + "}"])
def test_what_is_no_json_is_refused_with_its_place(text):
    with pytest.raises(RequestError, match="here: it is not JSON"):
        parse(text, "here")


def test_a_duplicate_member_is_refused_by_name():
    with pytest.raises(RequestError, match="here: it is not JSON: the member b is there twice"):
        parse('{"a": {"b": 1, "c": 2, "b": 3}}', "here")


@given(st.lists(st.text(), max_size=6))
def test_no_line_is_lost_but_empty_ones(texts):
    given_lines = [text.replace("\n", " ") + "\n" for text in texts]
    assert "".join(found.text for found in split(given_lines)).split() == "".join(given_lines).split()
