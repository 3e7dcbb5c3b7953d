"""Lines of keys in a TOML file."""

import pytest
from hypothesis import given
from hypothesis import strategies as some

from board.toml import parse
from firmware.box.toml_lines import line_of, syntax_hint

TEXT = """\
name = "x"  # 1
a.b = 2

[wifi]  # 4
country = "DE"
"a b" = 1
[[policy]]
name = "first"
[policy.match]
type = ["cam"]
[[policy]]
name = "second"
[interfaces.g5] # 13
driver = "udp"
[interfaces."x.y"]
driver = "udp"
inline = { deep = 1 }
"""


@pytest.mark.parametrize(
    ("path", "line"),
    [
        ("name", 1), ("a.b", 2), ("wifi", 4), ("wifi.country", 5), ('wifi."a b"', 6), ("policy[0].name", 8),
        ("policy[0].match.type", 10), ("policy[0].match.type[1]", 10), ("policy[1].name", 12),
        ("interfaces.g5.driver", 14), ('interfaces."x.y".driver', 16), ('interfaces."x.y".inline.deep', 17),
        ("wifi.ssid", 4), ("interfaces.g5.queue", 13), ("policy[1].rate", 11), ("none", None), ("", None),
        ("interfaces", 13), ("a", 2), ("interfaces.x", 13),
    ],
)  # fmt: skip
def test_a_key_stands_in_its_line_and_one_that_is_missing_in_that_of_its_table(path: str, line: int | None):
    assert line_of(TEXT, path) == line


@given(text=some.text(max_size=80), path=some.text(max_size=20))
def test_any_text_and_any_path_give_a_line_of_the_text_or_none(text: str, path: str):
    found = line_of(text, path)
    assert found is None or 1 <= found <= text.count("\n") + 1


def test_a_long_word_of_a_text_is_passed_over():
    # A pattern that takes a word apart in every way would not end within a lifetime.
    assert line_of(f'a = """\n{"x" * 100}\n{". " * 100}\n"""\nb = 1\n', "b") == 5


@pytest.mark.parametrize(
    "text", ["a = 1\na = 2", "[a]\n[a]", "a = {b = 1, b = 2}", "a = {b = 1}\na.c = 1", "[a.b]\n[a]\nb.c = 1"]
)
def test_what_stands_twice_is_told_to_stand_once(text: str):
    with pytest.raises(ValueError, match="line") as told:
        parse(text)
    assert syntax_hint(str(told.value)).startswith("each key and each [table] stands once")


def test_a_table_s_own_line_counts_before_those_below_it():
    assert line_of("[a.b]\n[a]\n", "a") == 2


def test_a_number_of_too_many_digits_is_told_with_its_line_whatever_long_ones_are_before_it():
    long = 5000 * "9"
    with pytest.raises(ValueError, match=r"^a number has too many digits \(at line 6, column 1\)$"):
        parse(f'a = 0.{long}\nb = {long}.5\nc = {long}e1\nd = 0x{long}\ne = "{long}"\nf = 9_{long}\n')


def test_what_is_no_value_is_told_to_stand_in_quotes():
    with pytest.raises(ValueError, match="Invalid value") as told:
        parse("a = b")
    assert syntax_hint(str(told.value)) == 'text stands in quotes: key = "value"'
