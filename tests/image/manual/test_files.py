"""Man pages and completion: read by mandoc, and used in real shells."""

import os
import re
import select
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from firmware.cli import VERBS
from image.manual import files
from image.project import PROJECT

DATE = 1_750_000_000  # 2025-06-15
SHELL_ENVIRONMENT = {"PATH": os.environ["PATH"], "TERM": "dumb", "PS1": "> "}
PATIENCE_S = 20.0


@pytest.fixture(scope="module")
def made() -> dict[str, str]:
    return files.made("1.2.3", DATE)


@pytest.fixture(scope="module")
def root(made: dict[str, str], tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("root")
    for name, text in made.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return folder


def test_captain_and_each_command_have_a_man_page(made: dict[str, str]):
    pages = {Path(name).name for name in made if name.startswith(files.MAN)}
    assert pages == {"captain.1", *(f"captain-{verb}.1" for verb in VERBS)}


def test_man_pages_of_all_commands_have_no_warning_of_mandoc(root: Path):
    pages = sorted((root / files.MAN).iterdir())
    ended = subprocess.run(
        ["mandoc", "-T", "lint", "-W", "warning", *pages], capture_output=True, text=True, check=False
    )
    assert ended.stdout + ended.stderr == ""


def test_man_page_as_text_has_options_examples_and_its_version(root: Path):
    page = root / files.MAN / "captain-listen.1"
    text = subprocess.run(["mandoc", "-T", "ascii", page], capture_output=True, text=True, check=True).stdout
    plain = re.sub(".\b", "", text)  # bold letters are printed twice
    assert "captain-listen - received messages, live" in plain
    assert "\n       --duration S\n" in plain
    assert "\nEXAMPLES\n       captain listen                            everything, until Ctrl-C\n" in plain
    assert plain.splitlines()[-1].split() == ["captain", "1.2.3", "2025-06-15", "CAPTAIN-LISTEN(1)"]


def test_files_made_on_another_terminal_are_the_same(made: dict[str, str], monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("COLUMNS", "40")
    assert files.made("1.2.3", DATE) == made


def test_files_contain_no_path_of_the_build(made: dict[str, str]):
    assert [name for name, text in made.items() if str(PROJECT) in text] == []


def test_choice_that_the_help_hides_is_not_completed(made: dict[str, str]):
    assert "_shtab_captain_box_pos_0_choices=(check setup)\n" in made[files.COMPLETION["bash"]]


def test_command_in_zsh_and_fish_is_described_by_its_summary(made: dict[str, str]):
    assert "\n    listen:'received messages, live'\n" in made[files.COMPLETION["zsh"]]
    assert " -a listen -d 'received messages, live'\n" in made[files.COMPLETION["fish"]]


@pytest.mark.parametrize(
    ("typed", "shown"),
    [
        ("captain li\t", "captain listen "),
        ("captain slot cy\t", "captain slot cycle "),
        ("captain listen --dur\t", "captain listen --duration "),
        ("captain run --config capt\t", "captain run --config captain.toml "),
    ],
)
def test_tab_in_bash_completes_command_argument_option_and_file(typed: str, shown: str, root: Path, tmp_path: Path):
    (tmp_path / "captain.toml").touch()
    screen = ""
    for octets in interactive_bash(f". {root}/{files.COMPLETION['bash']}\n{typed}", tmp_path):
        screen += octets.decode()
        if shown in screen:
            return
    pytest.fail(screen)


def interactive_bash(typed: str, folder: Path) -> Iterator[bytes]:
    """Type into a bash on a terminal of its own; yield the output as it comes, for at most PATIENCE_S."""
    ours, its = os.openpty()
    command = ["bash", "--norc", "--noprofile", "-i"]
    with subprocess.Popen(
        command, stdin=its, stdout=its, stderr=its, cwd=folder, env=SHELL_ENVIRONMENT, start_new_session=True
    ) as bash:
        os.write(ours, typed.encode())
        deadline = time.monotonic() + PATIENCE_S
        try:
            while select.select([ours], [], [], max(0.0, deadline - time.monotonic()))[0]:
                yield os.read(ours, 4096)
        finally:
            bash.kill()
            os.close(ours)
            os.close(its)
