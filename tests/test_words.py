"""Words: the rules of plain English find violations, and only these."""

import pytest

from tests.words import Text, findings, of_code, of_document, of_makefile


def rules_of(text: str, *, may_ask: bool = False) -> list[str]:
    return [one.rule for one in findings([Text("a.py", 1, "messages", text, may_ask)])]


@pytest.mark.parametrize(
    "text",
    [
        "What a pin is set to",
        "Whether it is up",
        "of a write",
        "the port is no number",
        "a limit that is told",
        "a record is none",
        "it stands in the file",
        "nobody answers",
        "one " * 26,
    ],
)
def test_words_with_a_violation_finds_one(text: str) -> None:
    assert len(rules_of(text)) == 1


@pytest.mark.parametrize(
    "text",
    [
        "Return the limit of a queue",
        "it is no longer up",
        "Raises ValueError where it is None",
        "How do I start it?",
        "one " * 25,
        f"{'one ' * 20}. {'Two ' * 20}",
        "`a b c d e f g h i j k l m n o p q r s t u v w x y z` and more",
    ],
)
def test_words_without_a_violation_finds_none(text: str) -> None:
    assert rules_of(text) == []


def test_words_of_a_bool_may_begin_with_whether() -> None:
    source = 'def a() -> bool:\n    """Whether it is up."""\ndef b() -> int:\n    """Whether it is up."""\n'
    assert [one.text.line for one in findings(of_code("drivers/a.py", source))] == [4]


def test_words_of_code_are_divided_by_kind() -> None:
    source = '"""What it is."""\n\n# Of a queue.\nA = 1\nraise E(f"{a} is no such number", help="What it does here")\n'
    found = findings(of_code("drivers/a.py", source))
    assert {(one.text.group, one.rule) for one in found} == {
        ("module docstrings", "first word"),
        ("comments", "first word"),
        ("messages", "phrase"),
        ("help", "first word"),
    }


def test_words_of_a_document_are_paragraphs_items_and_cells() -> None:
    source = "# How it works\n\nWhat\nit is.\n\n- Who may\n\n| a | nobody |\n\n```\nWhat is code\n```\n"
    found = findings(of_document("README.md", source))
    assert [(one.text.line, one.rule) for one in found] == [(3, "first word"), (6, "first word"), (8, "phrase")]


def test_words_of_a_makefile_are_the_help_of_its_targets() -> None:
    assert [one.text.line for one in findings(of_makefile("Makefile", "A = What\nrun: setup ## what it does\n"))] == [2]
