"""Man pages in roff: escapes, headings, tables."""

import argparse

from image.manual import page

HEAD = page.Head("1.2.3", "2025-06-15")


def lines(description: str = "Does it.", epilog: str = "") -> list[str]:
    parser = argparse.ArgumentParser("captain do", description=description, epilog=epilog)
    parser.add_argument("--rate", type=int, default=10, metavar="HZ", help="messages a second (default: %(default)s)")
    parser.add_argument("--hidden", help=argparse.SUPPRESS)
    parser.add_argument("file", nargs="+", metavar="FILE", help="where it is")
    return page.of(parser, "does it", HEAD).splitlines()


def test_page_of_a_command_has_title_name_and_synopsis():
    assert lines()[:7] == [
        '.TH "CAPTAIN\\-DO" 1 "2025-06-15" "captain 1.2.3" "User Commands"',
        ".SH NAME",
        "captain\\-do \\- does it",
        ".SH SYNOPSIS",
        "captain do [\\-h] [\\-\\-rate HZ] FILE [FILE ...]",
        ".SH DESCRIPTION",
        "Does it.",
    ]


def test_option_with_default_shows_placeholder_and_value():
    at = lines().index("\\fB\\-\\-rate HZ\\fR")
    assert lines()[at - 1 : at + 2] == [".TP", "\\fB\\-\\-rate HZ\\fR", "messages a second (default: 10)"]


def test_suppressed_option_is_not_in_the_page():
    assert "hidden" not in "\n".join(lines())


def test_table_keeps_its_lines_below_a_heading():
    assert lines(epilog="exit codes:\n  0  done\n  1  not")[-7:-2] == [
        ".SH EXIT CODES",
        ".nf",
        "0  done",
        "1  not",
        ".fi",
    ]


def test_heading_with_names_keeps_their_letters():
    assert ".SH JSON with \\-\\-decode" in lines(epilog="JSON with --decode:\n  a  b")


def test_text_with_roff_commands_and_typographic_characters_is_escaped():
    assert lines(".so x's `y` \\n ~^")[6] == "\\&.so x\\(aqs \\(gay\\(ga \\en \\(ti\\(ha"


def test_overview_lists_commands_by_group():
    text = page.overview("captain", "a station", "captain COMMAND", {"use": {"run": "run it"}}, HEAD)
    assert ".SS use\n.TP\n.BR captain\\-run (1)\nrun it\n" in text
