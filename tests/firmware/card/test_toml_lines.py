"""Lines of keys in a TOML file."""

import pytest
from hypothesis import given
from hypothesis import strategies as some

from board.runtime.toml import parse
from firmware.card.toml_lines import line_of, syntax_hint

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
def test_key_is_in_its_line_and_a_missing_one_in_that_of_its_table(path: str, line: int | None):
    assert line_of(TEXT, path) == line


@given(text=some.text(max_size=80), path=some.text(max_size=20))
def test_text_and_path_of_any_letters_give_a_line_of_the_text_or_none(text: str, path: str):
    found = line_of(text, path)
    assert found is None or 1 <= found <= text.count("\n") + 1


def test_text_with_a_long_word_is_passed_over_at_once():
    # A pattern that takes a word apart in every way would not end within a lifetime.
    assert line_of(f'a = """\n{"x" * 100}\n{". " * 100}\n"""\nb = 1\n', "b") == 5


@pytest.mark.parametrize(
    ("text", "value"),
    [
        *((text, "[table]") for text in ("a = 1\na = 2", "[a]\n[a]", "a = {b = 1, b = 2}", "a = {b = 1}\na.c = 1", "[a.b]\n[a]\nb.c = 1")),
        ("a = b", 'key = "value"'),
        (f"a = {5000 * '9'}", 'key = "value"'),
        ("[a", "guides"),
    ],
)  # fmt: skip
def test_text_that_is_not_toml_has_the_remedy_of_its_cause(text: str, value: str):
    with pytest.raises(ValueError, match="line") as told:
        parse(text)
    assert value in syntax_hint(str(told.value))


def test_table_with_a_line_of_its_own_is_there():
    assert line_of("[a.b]\n[a]\n", "a") == 2


def test_number_of_too_many_digits_is_told_with_its_line():
    long = 5000 * "9"
    with pytest.raises(ValueError, match=r"^a number has too many digits \(at line 6, column 1\)$"):
        parse(f'a = 0.{long}\nb = {long}.5\nc = {long}e1\nd = 0x{long}\ne = "{long}"\nf = 9_{long}\n')
