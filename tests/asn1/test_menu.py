"""The menu: asked in words, run as the same command line that the flags take."""

import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest

from asn1 import cli as program
from asn1 import menu
from asn1.backends.registry import BACKENDS
from asn1.model import text
from asn1.own import add
from tests.said import tells

CAM = ["generate", "cam", "--format"]


class Answers:
    """A user who types these lines, and then ends the input."""

    def __init__(self, *lines: str) -> None:
        self._lines: Iterator[str] = iter(lines)

    def __call__(self, prompt: str = "") -> str:
        try:
            return next(self._lines)
        except StopIteration:
            raise EOFError from None


def run(monkeypatch: pytest.MonkeyPatch, *lines: str, status: int = 0) -> tuple[list[list[str]], int]:
    """The command lines that the menu makes of a user's answers, and its exit status."""
    started: list[list[str]] = []

    def start(line: list[str]) -> int:
        program.arguments().parse_args(line)  # the flags take it
        started.append(line)
        return status

    monkeypatch.setattr("builtins.input", Answers(*lines))
    return started, menu.run(start)


def test_the_first_choice_lists(monkeypatch: pytest.MonkeyPatch):
    assert run(monkeypatch, "1") == ([["list"]], 0)


def test_the_standard_set_goes_into_a_directory_of_choice(monkeypatch: pytest.MonkeyPatch):
    started, _ = run(monkeypatch, "2", "1", "1", "n", "/tmp/here")
    assert started == [["generate", "--standard", "--format", "cmake", "--to", "/tmp/here"]]


def test_an_empty_answer_takes_the_default(monkeypatch: pytest.MonkeyPatch):
    started, _ = run(monkeypatch, "2", "2", "5", "")
    assert started == [["generate", "--all", "--format", "docs", "--to", "build/docs"]]


def test_messages_can_be_named_and_their_names_are_shown(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    started, _ = run(monkeypatch, "2", "3", "cam 'cpm-*'", "2", "", "out")
    assert "cam-1.4.1" in capsys.readouterr().out
    assert started == [["generate", "cam", "cpm-*", "--format", "sources", "--to", "out"]]


def test_ros_2_packages_have_the_names_of_somebody(monkeypatch: pytest.MonkeyPatch):
    form = str(list(BACKENDS).index("ros2") + 1)
    started, _ = run(monkeypatch, "2", "3", "cam", form, "2", "3", "out")
    asked = [*CAM, "ros2", "--profile", "v2x_msgs", "--distro", "kilted", "--to", "out"]
    assert started == [asked]


def test_ros_2_packages_do_not_go_where_the_ros_of_the_tests_is(monkeypatch: pytest.MonkeyPatch):
    form = str(list(BACKENDS).index("ros2") + 1)
    [line], _ = run(monkeypatch, "2", "3", "cam", form, "1", "1", "")
    assert line[-2:] == ["--to", "build/ros2-packages"]


def test_a_wheel_for_the_gateway_is_asked_for(monkeypatch: pytest.MonkeyPatch):
    form = str(list(BACKENDS).index("wheel") + 1)
    started, _ = run(monkeypatch, "2", "3", "cam", form, "y", "out")
    assert started == [[*CAM, "wheel", "--ros2", "--to", "out"]]


@pytest.fixture
def file(tmp_path: Path) -> str:
    path = tmp_path / "my.asn"
    path.write_text("M DEFINITIONS ::= BEGIN MyPdu ::= SEQUENCE { a NULL } v INTEGER ::= 3 END")
    return str(path)


def test_a_message_of_one_s_own_is_asked_for_in_full(monkeypatch: pytest.MonkeyPatch, file: str):
    started, _ = run(monkeypatch, "3", file, "MyPdu", "my-msg", "240", "2999")
    assert started == [["add", file, "--pdu", "MyPdu", "--name", "my-msg", "--id", "240", "--port", "2999"]]


def test_each_answer_is_checked_when_it_is_given_and_asked_for_again(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], file: str
):
    answers = [
        "nowhere.asn",
        file,
        "Mypdu",
        "v",
        "MyPdu",
        "My Msg",
        "cam",
        "my-msg",
        "many",
        "256",
        "240",
        "-1",
        "2999",
    ]
    started, _ = run(monkeypatch, "3", *answers)
    assert started == [["add", file, "--pdu", "MyPdu", "--name", "my-msg", "--id", "240", "--port", "2999"]]
    said = capsys.readouterr().out
    for reason in ("nowhere.asn: file not found", "did you mean MyPdu", "v: my.asn defines no such type", "lower-case letters",
                   "choose another name", "'many': out of range; 0 to 255", "'256'", "'-1': out of range"):  # fmt: skip
        assert reason in said


def test_several_files_of_a_message_are_asked_for_at_once(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, file: str):
    (tmp_path / "common types.asn").write_text("Common DEFINITIONS ::= BEGIN Level ::= INTEGER (0..3) END")
    both = [file, str(tmp_path / "common types.asn")]
    answers = [f"{file} nowhere.asn", f"{file} 'open", shlex.join(both), "Missing", "Level", "my-msg", "240", "2999"]
    (line,), _ = run(monkeypatch, "3", *answers)
    assert line == ["add", *both, "--pdu", "Level", "--name", "my-msg", "--id", "240", "--port", "2999"]


def test_a_name_that_is_there_is_replaced_only_if_the_user_says_so(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, file: str
):
    monkeypatch.setattr(text, "SCHEMA", tmp_path)
    (tmp_path / "my-msg.toml").write_text("")
    assert run(monkeypatch, "3", file, "MyPdu", "my-msg", "n", "1")[0] == [["list"]]
    (line,), _ = run(monkeypatch, "3", file, "MyPdu", "my-msg", "y", "240", "2999")
    assert line[-1] == "--replace"


def test_message_of_a_user_is_removed_by_its_number(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, file: str, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.setattr(text, "SCHEMA", tmp_path)
    assert run(monkeypatch, "4", "1")[0] == [["list"]]
    assert tells(capsys.readouterr().out, "not added", "message")
    add.add(add.UserRequest(Path(file), "MyPdu", "my-msg", 240, 2999), text.load_schema(), tmp_path)
    here = text.load_schema(tmp_path)
    monkeypatch.setattr(text, "load_schema", lambda: here)
    assert run(monkeypatch, "4", "1")[0] == [["remove", "my-msg"]]


def test_a_number_that_is_none_is_asked_for_again(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    started, _ = run(monkeypatch, "9", "x", "1")
    assert started == [["list"]]
    assert "out of range; 1 to" in capsys.readouterr().out


def test_the_command_line_is_shown_so_that_it_can_be_repeated(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    run(monkeypatch, "2", "3", "'cpm-*'", "2", "", "my dir")
    assert "$ captain-asn1 generate 'cpm-*' --format sources --to 'my dir'" in capsys.readouterr().out


def test_an_empty_answer_goes_back_and_q_ends(monkeypatch: pytest.MonkeyPatch):
    assert run(monkeypatch, "2", "", "1", "q", "1") == ([["list"]], 0)
    assert run(monkeypatch, "2", "q", "1") == ([], 0)


def test_the_status_of_the_last_command_is_the_menu_s(monkeypatch: pytest.MonkeyPatch):
    assert run(monkeypatch, "1", status=1)[1] == 1


def test_a_wrong_answer_is_explained_and_the_menu_goes_on(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    started, _ = run(monkeypatch, "2", "3", "--no-such-flag", "2", "", "out", "1")
    assert started == [["list"]]
    assert (
        "captain-asn1 generate: error: unknown option: --no-such-flag; see captain-asn1 generate --help"
        in capsys.readouterr().err
    )
