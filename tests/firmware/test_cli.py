"""Command line: help, wrong usage, failures."""

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from board.runtime.errors import ConfigurationError, StationError, UsageError
from firmware import VERSION, cli, commands
from tests.said import tells

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("argv", [["--help"], ["-h"], ["help"]])
def test_help_that_is_asked_for_names_every_command(argv: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(argv) == 0
    said = capsys.readouterr()
    assert all(verb in said.out for verb in cli.VERBS)
    assert said.err == ""


@pytest.mark.parametrize("argv", [["--version"], ["-V"]])
def test_the_version_is_told(argv: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(argv) == 0
    assert capsys.readouterr().out == f"captain {VERSION}\n"


def test_wrong_usage_without_a_command_shows_all_on_stderr(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main([]) == cli.USAGE_ERROR
    said = capsys.readouterr()
    assert said.out == ""
    assert all(verb in said.err for verb in cli.VERBS)


@pytest.mark.parametrize(
    ("word", "told"),
    [
        ("rum", "unknown command: 'rum'; did you mean run?"),
        ("lisen", "unknown command: 'lisen'; did you mean listen?"),
        ("Run", "unknown command: 'Run'; did you mean run?"),
        ("run ", "unknown command: 'run '; did you mean run?"),
        ("", "unknown command: ''; `captain --help` shows all"),
        ("xyzzy\x1b[2J", "unknown command: 'xyzzy\\x1b[2J'; `captain --help` shows all"),
        ("--verson", "unknown option: '--verson'; did you mean --version?"),
        ("-v", "unknown option: '-v'; `captain --help` shows all"),
    ],
)
def test_an_unknown_command_is_the_last_line_with_the_nearest_one(
    word: str, told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main([word]) == cli.USAGE_ERROR
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("usage: captain COMMAND")
    assert err.splitlines()[-1] == f"captain: {told}"
    assert len(err.splitlines()) < 24


@pytest.mark.parametrize(
    ("argv", "told"),
    [
        (["listen", "--tpye", "cam"], "captain listen: error: unknown option: --tpye; did you mean --type?"),
        (["listen", "--tpye=cam"], "captain listen: error: unknown option: --tpye; did you mean --type?"),
        (["status", "--js"], "captain status: error: unknown option: --js; did you mean --json?"),
        (["status", "cam"], "captain status: error: unexpected argument: 'cam'; see captain status --help"),
        (["status", "-q"], "captain status: error: unknown option: -q; see captain status --help"),
        (["slot", "cycel", "1"], "captain slot: error: unknown value: 'cycel'; did you mean cycle?"),
        (
            ["send", "--format", "x", "y"],
            "captain send: error: argument --format: unknown value: 'x'; known: hex, base64, binary, json",
        ),
    ],
)
def test_wrong_usage_ends_with_the_error_and_the_nearest_word(
    argv: list[str], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit, match=str(cli.USAGE_ERROR)):
        cli.main(argv)
    assert capsys.readouterr().err.splitlines()[-1] == told


def test_an_unknown_option_of_a_subcommand_is_compared_with_the_options_of_that(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def arguments(parser: argparse.ArgumentParser) -> None:
        verbs = parser.add_subparsers(dest="do", required=True)
        verbs.add_parser("open").add_argument("--width")
        verbs.add_parser("close").add_argument("--speed")

    command = SimpleNamespace(DESCRIPTION="x", EPILOG="y", arguments=arguments, main=lambda arguments: 0)
    monkeypatch.setattr(cli, "load", lambda verb: command)
    for argv, told in (
        (["open", "--widht", "1"], "captain run open: error: unknown option: --widht; did you mean --width?"),
        (["opne"], "captain run: error: unknown command: 'opne'; did you mean open?"),
    ):
        with pytest.raises(SystemExit, match=str(cli.USAGE_ERROR)):
            cli.main(["run", *argv])
        assert capsys.readouterr().err.splitlines()[-1] == told


def test_help_of_one_command_is_that_of_its_option(capsys: pytest.CaptureFixture[str]) -> None:
    said = []
    for argv in (["help", "slot"], ["slot", "--help"]):
        with pytest.raises(SystemExit, match="0"):
            cli.main(argv)
        said.append(capsys.readouterr().out)
    assert said[0] == said[1] != ""


@pytest.mark.parametrize("verb", list(cli.VERBS))
def test_help_has_80_columns(verb: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    with pytest.raises(SystemExit):
        cli.main([verb, "--help"])
    assert [line for line in capsys.readouterr().out.splitlines() if len(line) > 80] == []


@pytest.mark.parametrize("verb", list(cli.VERBS))
def test_load_of_every_verb_returns_the_module_of_its_name(verb: str) -> None:
    assert cli.load(verb).__name__ == f"firmware.commands.{verb.replace('-', '_')}"


def test_verbs_are_the_modules_of_commands() -> None:
    modules = {path.stem for path in Path(commands.__path__[0]).glob("*.py")} - {"__init__"}
    assert {verb.replace("-", "_") for verb in cli.VERBS} == modules


def test_help_fits_a_screen_in_two_aligned_columns(capsys: pytest.CaptureFixture[str]) -> None:
    cli.main(["--help"])
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) < 24
    assert max(map(len, lines)) < 80
    found = {
        line.index(f"{verb} ", at)
        for verb in cli.VERBS
        for line in lines
        for at in (2, 42)
        if line.startswith(verb, at)
    }
    assert found == {2, 42}
    assert all(any(summary in line for line in lines) for summary in cli.VERBS.values())


@pytest.mark.parametrize("verb", list(cli.VERBS))
def test_every_command_has_help_of_its_own(verb: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        cli.main([verb, "--help"])
    assert caught.value.code == 0
    assert f"usage: captain {verb}" in capsys.readouterr().out


@pytest.mark.parametrize("verb", list(cli.VERBS))
def test_an_option_that_no_command_has_is_wrong_usage(verb: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        cli.main([verb, "--no-such-option"])
    assert caught.value.code == cli.USAGE_ERROR
    assert f"captain {verb}: error: " in capsys.readouterr().err


def a_command_that_raises(error: BaseException, monkeypatch: pytest.MonkeyPatch) -> None:
    def main(arguments: object) -> int:
        raise error

    def arguments(parser: argparse.ArgumentParser) -> None:
        parser.add_argument("--json", action="store_true")

    command = SimpleNamespace(DESCRIPTION="x", EPILOG="y", arguments=arguments, main=main)
    monkeypatch.setattr(cli, "load", lambda verb: command)


@pytest.mark.parametrize("south_west", ["-20.5,100", "-20.5,-100", "-.5,0"])
def test_a_value_may_begin_with_a_minus(south_west: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        cli.main(["replay", "x.hex", "--shift", south_west, "--speed", "0"])
    assert "argument --speed" in capsys.readouterr().err


def test_an_expected_failure_is_told_in_words(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    a_command_that_raises(StationError("port 5555 is taken", "choose another"), monkeypatch)
    assert cli.main(["run"]) == 1
    said = capsys.readouterr()
    assert said.err == "captain: port 5555 is taken\n  (choose another)\n"
    assert said.out == ""


def test_nothing_that_a_failure_names_makes_lines_or_is_obeyed_by_a_terminal(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    a_command_that_raises(StationError("a\ncaptain: all is well\x1b[2J: no such file", "is b\rthere?"), monkeypatch)
    cli.main(["run"])
    said = "captain: a\\x0acaptain: all is well\\x1b[2J: no such file\n  (is b\\x0dthere?)\n"
    assert capsys.readouterr().err == said


def test_the_mistakes_of_a_file_keep_a_line_each(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    a_command_that_raises(ConfigurationError("a.toml: x: is none\na.toml: y\t: is none"), monkeypatch)
    cli.main(["run"])
    assert capsys.readouterr().err == "captain: a.toml: x: is none\na.toml: y\\x09: is none\n"


@pytest.mark.parametrize(
    ("argv", "prog"),
    [
        (["status", "--json", "--nonsense"], "captain status"),
        (["slot", "--json"], "captain slot"),
        (["meter", "live", "--json", "--nonsense"], "captain meter"),
        (["time", "--json", "--watch=often"], "captain time"),
    ],
)
def test_wrong_usage_with_json_is_an_object_too(argv: list[str], prog: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match=str(cli.USAGE_ERROR)):
        cli.main(argv)
    out, err = capsys.readouterr()
    said = json.loads(out)
    assert said == {"error": said["error"], "hint": f"{prog} --help"}
    assert said["error"] in err


def test_wrong_usage_without_json_leaves_standard_output_empty(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match=str(cli.USAGE_ERROR)):
        cli.main(["status", "--nonsense"])
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize(("kind", "code"), [(StationError, 1), (UsageError, cli.USAGE_ERROR)])
def test_a_program_that_asked_for_json_has_an_expected_failure_as_an_object_too(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], kind: type[StationError], code: int
) -> None:
    a_command_that_raises(kind("port 5555 is taken", "choose another"), monkeypatch)
    assert cli.main(["run", "--json"]) == code
    said = capsys.readouterr()
    assert json.loads(said.out) == {"error": "port 5555 is taken", "hint": "choose another"}
    assert said.err == "captain: port 5555 is taken\n  (choose another)\n"


def test_an_interrupt_is_no_traceback(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    a_command_that_raises(KeyboardInterrupt(), monkeypatch)
    assert cli.main(["run"]) == cli.INTERRUPTED
    assert capsys.readouterr().err == ""


def test_a_bug_passes_through(monkeypatch: pytest.MonkeyPatch) -> None:
    a_command_that_raises(ZeroDivisionError(), monkeypatch)
    with pytest.raises(ZeroDivisionError):
        cli.main(["run"])


def captain(
    *argv: str, stdout: int = subprocess.PIPE, stderr: int = subprocess.PIPE, unbuffered: str = ""
) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(
        [sys.executable, "-m", "firmware", *argv],
        cwd=ROOT,
        env={**os.environ, "PYTHONUNBUFFERED": unbuffered},
        stdout=stdout,
        stderr=stderr,
        text=True,
        timeout=20,
        check=False,
    )


def test_configuration_with_mistakes_ends_the_program_with_1_and_no_traceback(tmp_path: Path) -> None:
    path = tmp_path / "captain.toml"
    path.write_text("[station]\nnam = 5\n[endpoint]\npull = 99999\n")
    ended = captain("run", "--config", str(path))
    assert ended.returncode == 1
    assert "Traceback" not in ended.stderr
    assert tells(ended.stderr, f"{path}: station.nam: ", "not a known key; ", " name?")
    assert f"{path}: endpoint.pull: " in ended.stderr


@pytest.mark.parametrize("unbuffered", ["", "1"])
@pytest.mark.parametrize("argv", [["--help"], ["status", "--help"]])
def test_a_reader_that_has_left_is_no_failure(argv: list[str], unbuffered: str) -> None:
    read, write = os.pipe()
    os.close(read)
    try:
        ended = captain(*argv, stdout=write, unbuffered=unbuffered)
    finally:
        os.close(write)
    assert (ended.returncode, ended.stderr) == (0, "")


def with_a_reader_that_has_left(
    *argv: str, unbuffered: str, errors_too: bool = False
) -> "subprocess.CompletedProcess[str]":
    read, write = os.pipe()
    os.close(read)
    try:
        return captain(*argv, stdout=write, stderr=write if errors_too else subprocess.PIPE, unbuffered=unbuffered)
    finally:
        os.close(write)


@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_reader_that_has_left_makes_no_success_of_a_mistake(tmp_path: Path, unbuffered: str) -> None:
    path = tmp_path / "captain.toml"
    path.write_text("[endpoint]\npull = 99999\nfoo = 1\n")
    wrong = ["--config", str(path)]
    assert with_a_reader_that_has_left("run", *wrong, unbuffered=unbuffered, errors_too=True).returncode == 1
    assert with_a_reader_that_has_left("selftest", "--json", *wrong, unbuffered=unbuffered).returncode == 1


@pytest.mark.parametrize("verb", sorted(cli.JUDGES))
@pytest.mark.parametrize("verdict", [0, 1])
def test_a_command_that_judges_does_so_though_nobody_reads_it(
    verb: str, verdict: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    read, write = os.pipe()
    os.close(read)

    def main(arguments: object) -> int:
        for _ in range(3):
            print("ok", flush=True)
        print("not written yet")
        return verdict

    command = SimpleNamespace(DESCRIPTION="", EPILOG="", arguments=lambda parser: None, main=main)
    monkeypatch.setattr(cli, "load", lambda verb: command)
    stream = os.fdopen(write, "w")
    with monkeypatch.context() as patch:
        patch.setattr(sys, "stdout", stream)
        assert cli.main([verb]) == verdict
    stream.close()


@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_wrong_usage_is_wrong_though_nobody_reads_it(unbuffered: str) -> None:
    assert with_a_reader_that_has_left("status", "--nonsense", unbuffered=unbuffered, errors_too=True).returncode == 2
    assert with_a_reader_that_has_left("nonsense", unbuffered=unbuffered, errors_too=True).returncode == 2


def test_a_command_that_was_cut_off_by_its_reader_is_not_done(monkeypatch: pytest.MonkeyPatch) -> None:
    read, write = os.pipe()
    os.close(read)

    def main(arguments: object) -> int:
        print("half of it", flush=True)
        return 0

    command = SimpleNamespace(DESCRIPTION="", EPILOG="", arguments=lambda parser: None, main=main)
    monkeypatch.setattr(cli, "load", lambda verb: command)
    stream = os.fdopen(write, "w")
    with monkeypatch.context() as patch:
        patch.setattr(sys, "stdout", stream)
        assert cli.main(["status"]) == 141
    stream.close()


@pytest.mark.parametrize("verb", ["run", "doctor"])
def test_file_of_2003_mistakes_gives_fifty_and_their_count(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], verb: str
) -> None:
    wrong = tmp_path / "captain.toml"
    wrong.write_text("".join(f"word{number} = 1\n" for number in range(2003)))
    assert cli.main([verb, "--config", str(wrong)]) == 1
    said = " ".join("".join(capsys.readouterr()).split())  # the doctor folds lines
    assert said.count("is not a known key") == 50
    assert tells(said, "1953 more mistakes; ", "right file")
