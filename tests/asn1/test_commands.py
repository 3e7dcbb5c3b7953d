"""The command line: what it prints, what it writes, and how it says that something is wrong."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from asn1 import cli as program
from asn1 import commands, progress
from asn1.model import selection, text
from tests.said import tells

ROOT = Path(__file__).resolve().parents[2]
ASN = "Mine DEFINITIONS AUTOMATIC TAGS ::= BEGIN Alarm ::= SEQUENCE { level INTEGER (0..7), ... } END\n"


def run(*words: object) -> int:
    """The exit status, argparse's own among them."""
    try:
        return program.main([str(word) for word in words])
    except SystemExit as error:
        return int(error.code or 0)


def test_the_list_names_every_message_with_its_standard(capsys: pytest.CaptureFixture[str]):
    assert run("list") == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split() == ["message", "release", "BTP", "port", "standard"]
    assert any(line.split()[0] == "cam-1.4.1" and line.endswith("ETSI EN 302 637-2 v1.4.1") for line in lines)


def test_the_list_as_json_is_an_object_a_line(capsys: pytest.CaptureFixture[str]):
    assert run("list", "--json") == 0
    messages = {one["name"]: one for one in map(json.loads, capsys.readouterr().out.splitlines())}
    assert messages["denm-1.3.1"]["btp_port"] == 2002
    assert messages["cam-1.4.1"]["ids"] == [2]


def test_generate_reports_what_was_written_and_where_to_begin(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    assert run("generate", "cam", "denm-1.3.1", "--format", "docs", "--to", tmp_path / "out") == 0
    said = capsys.readouterr()
    summary, begin = said.out.splitlines()
    assert tells(summary, f"{tmp_path}/out: ", "2 messages", "docs; ", "3 files changed")
    assert begin.endswith(f" {tmp_path}/out/README.md")
    assert said.err == "[1/2] cam-1.4.1\n[2/2] denm-1.3.1\n"
    assert run("generate", "cam", "denm-1.3.1", "--form", "docs", "--to", tmp_path / "out") == 0
    assert "0 files changed" in capsys.readouterr().out


def test_asn_1_text_of_a_message_holds_the_modules_that_it_needs_and_no_others(tmp_path: Path):
    assert run("generate", "cam-1.4.1", "--format", "asn", "--to", tmp_path / "out") == 0
    assert sorted(path.name for path in (tmp_path / "out").glob("*.asn")) == ["r1_cam.asn", "r1_cdd.asn"]


@pytest.mark.parametrize(
    ("words", "status", "says"),
    [
        (["generate", "--to", "OUT"], 2, "no messages chosen"),
        (["generate", "cam", "--all", "--to", "OUT"], 2, "exclude each other"),
        (["generate", "cm", "--to", "OUT"], 2, "did you mean"),
        (["generate", "cam"], 2, "required: --to"),
        (["generate", "cam", "--format", "rust", "--to", "OUT"], 2, "unknown value: 'rust'; known: cmake, "),
        (["generate", "cam", "--format", "dosc", "--to", "OUT"], 2, "unknown value: 'dosc'; did you mean docs?"),
        (["generate", "cam", "--fromat", "docs", "--to", "OUT"], 2, "unknown option: --fromat; did you mean --format?"),
        (
            ["generate", "cam", "--prof", "etsi_its", "--to", "OUT"],
            2,
            "unknown option: --prof; did you mean --profile?",
        ),
        (["list", "--jsn"], 2, "captain-asn1 list: error: unknown option: --jsn; did you mean --json?"),
        (["list", "cam"], 2, "unexpected argument: 'cam'; see captain-asn1 list --help"),
        (["generate", "cam", "--to", "."], 1, "not written by captain-asn1"),
        (["generate", "cam", "--format", "docs", "--to", "/proc/out"], 1, "/proc/"),
        (["import", "OUT"], 1, "contains no file of editions.toml"),
        (["import-check", "OUT"], 1, "contains no file of editions.toml"),
        (["list", "--with", "OUT"], 1, "captain-asn1 add"),
        (["add", "no.asn", "--pdu", "A", "--name", "b", "--id", "1", "--port", "2"], 1, "no.asn: No such file"),
        (["compile"], 2, "unknown command: 'compile'; known: list, "),
        (["generat"], 2, "unknown command: 'generat'; did you mean generate?"),
        ([], 2, "required: COMMAND"),
    ],
)
def test_what_is_wrong_is_said_in_a_line_and_writes_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], status: int, says: str
):
    assert run(*(str(tmp_path / "out") if word == "OUT" else word for word in words)) == status
    said = capsys.readouterr().err
    assert says in said
    assert said.splitlines()[-1].startswith("captain-asn1")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ("--format", "cmake", "--profile", "v2x_msgs"),
            "--profile: not an option of --format cmake; it needs --format ros2",
        ),
        (
            ("--format", "docs", "--distro", "humble"),
            "--distro: not an option of --format docs; it needs --format ros2",
        ),
        (
            ("--format", "ros2", "--ros2"),
            "--ros2: not an option of --format ros2; it needs --format cmake or sources or python or wheel",
        ),
    ],
)
def test_an_option_of_another_form_is_refused(words, said, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    assert run("generate", "rawtx", *words, "--to", tmp_path / "out") == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_ros_package_that_is_not_asked_for_again_is_removed_and_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    for name in ("rawtx", "rawrx"):
        assert run("generate", name, "--format", "ros2", "--to", tmp_path / "src") == 0
    assert tells(capsys.readouterr().out, "removed", ": captain_rawtx_1_msgs\n")
    assert sorted(path.name for path in (tmp_path / "src").iterdir() if path.is_dir()) == [
        "captain_rawrx_1_msgs",
        "captain_si",
    ]


def test_message_of_a_user_is_added_with_one_command_and_listed(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    (tmp_path / "my.asn").write_text(ASN)
    assert run("add", tmp_path / "my.asn", "--pdu", "Alarm", "--name", "my-alarm", "--id", 2, "--port", 2999,
               "--to", tmp_path / "own") == 0  # fmt: skip
    said, warned = capsys.readouterr()
    assert tells(warned, "octets 0 and 1 ", "messageID: Alarm ", "extension bit")
    assert "needs --edition my-alarm" in warned
    assert tells(said, "messageID 2 ", "cam-1.4.1")
    assert f"generate my-alarm --with {tmp_path / 'own'}" in said
    assert run("list", "--with", tmp_path / "own") == 0
    assert "my-alarm" in capsys.readouterr().out
    assert run("remove", "my-alarm", "--to", tmp_path / "own") == 0
    assert f"removed: {tmp_path / 'own' / 'my-alarm.toml'}" in capsys.readouterr().out
    assert run("remove", "my-alarm", "--to", tmp_path / "own") == 1
    assert tells(capsys.readouterr().err, "my-alarm: ", "not a message", str(tmp_path / "own"))


def test_directories_with_a_module_of_the_same_key_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    (tmp_path / "my.asn").write_text(ASN)
    for name, folder in (("my-alarm", "one"), ("my.alarm", "two")):
        assert run("add", tmp_path / "my.asn", "--pdu", "Alarm", "--name", name, "--id", 2, "--port", 2999,
                   "--to", tmp_path / folder) == 0  # fmt: skip
    assert run("list", "--with", tmp_path / "one", "--with", tmp_path / "two") == 1
    assert tells(capsys.readouterr().err, "two: x_my_alarm.schema ", "another directory")


WITHOUT_ASN1TOOLS = """
import sys
sys.modules["asn1tools"] = None
from asn1.__main__ import main
sys.exit(main(sys.argv[1:]))
"""


def run_without_asn1tools(*words: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", WITHOUT_ASN1TOOLS, *map(str, words)]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)


def test_only_what_reads_modules_needs_asn1tools(tmp_path: Path):
    done = run_without_asn1tools("generate", "cam", "--format", "docs", "--to", tmp_path / "out")
    assert (done.returncode, done.stderr) == (0, "[1/1] cam-1.4.1\n")


def test_add_without_asn1tools_fails_with_its_installation(tmp_path: Path):
    (tmp_path / "my.asn").write_text(ASN)
    done = run_without_asn1tools("add", tmp_path / "my.asn", "--pdu", "Alarm", "--name", "my-alarm", "--id", 2,
                                 "--port", 2999, "--to", tmp_path / "own")  # fmt: skip
    assert done.returncode == 1
    assert tells(done.stderr, "captain-asn1: asn1tools", "not installed", "pip install asn1tools")
    assert not (tmp_path / "own").exists()


def test_import_check_shows_the_difference(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(commands, "_with_modules", lambda folder: folder)
    monkeypatch.setattr("asn1.importer.standards.import_modules", lambda folder, tell: text.load_schema())
    monkeypatch.setattr("asn1.importer.standards.compare", lambda schema, folder: ["--- a", "+++ b", "-old", "+new"])
    assert run("import-check", tmp_path) == 1
    assert capsys.readouterr().out.splitlines() == ["--- a", "+++ b", "-old", "+new"]


def test_import_check_compares_the_codecs_where_the_schema_is_the_same(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(commands, "_with_modules", lambda folder: folder)
    monkeypatch.setattr(
        "asn1.importer.standards.import_modules", lambda folder, tell: selection.part(text.load_schema(), ["cam-1.4.1"])
    )
    monkeypatch.setattr("asn1.importer.standards.compare", lambda schema, folder: [])
    assert run("import-check", tmp_path) == 0
    assert tells(capsys.readouterr().out, "2 modules", ": schema and codecs ", "equal")


def test_a_reader_that_leaves_is_no_error():
    command = f"{sys.executable} -m asn1 list --json | head -n 1"
    done = subprocess.run(command, shell=True, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.stdout.count("\n") == 1
    assert done.stderr == ""


class Terminal:
    """A stream that says it is a terminal."""

    def __init__(self) -> None:
        self.text = ""

    def isatty(self) -> bool:
        return True

    def write(self, text: str) -> int:
        self.text += text
        return len(text)

    def flush(self) -> None:
        pass


def test_on_a_terminal_progress_is_one_line_that_is_gone_in_the_end():
    terminal = Terminal()
    steps = progress.Steps(2, terminal)  # type: ignore[arg-type]
    steps("a long name " * 20)
    steps("short")
    steps.finish()
    assert "\n" not in terminal.text
    assert "\r[2/2] short " in terminal.text
    assert terminal.text.rstrip(" \r").endswith("short")


# Imported by Python at its start: Ctrl-C is pressed while the program loads its first module.
PRESSED = """\
import sys

class Pressed:
    def find_spec(self, name, *_):
        if name.startswith("asn1.") and name != "asn1.__main__":
            raise KeyboardInterrupt

sys.meta_path.insert(0, Pressed())
"""


def test_ctrl_c_while_the_program_loads_is_quiet(tmp_path: Path):
    (tmp_path / "sitecustomize.py").write_text(PRESSED)
    ended = subprocess.run(
        [sys.executable, "-m", "asn1", "list"],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (ended.returncode, ended.stdout, ended.stderr) == (130, "", "\n")


@pytest.mark.parametrize(
    ("name", "remedy"),
    [("none.asn", "No such file or directory; name an existing file"), (".", "Is a directory; name a file")],
)
def test_add_of_a_file_that_cannot_be_read_names_the_remedy_of_its_errno(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, remedy: str
) -> None:
    add = [
        "add",
        tmp_path / name,
        "--pdu",
        "A",
        "--name",
        "mine",
        "--id",
        200,
        "--port",
        3000,
        "--to",
        tmp_path / "own",
    ]
    assert run(*add) == 1
    assert remedy in capsys.readouterr().err
