"""Paths of Unix sockets: one that is too long for unix(7) is refused when it is read, with its length."""

import tempfile
from contextlib import closing

import pytest
import zmq

from board.runtime.errors import ConfigurationError, InterfaceError
from board.runtime.loop import Loop
from board.runtime.scratch import Scratch
from firmware import cli
from firmware.config import captain_toml
from firmware.endpoint.control.control_socket import ControlSocket
from firmware.endpoint.publisher import bind

MOST = 107  # octets: sun_path has 108 with the zero behind
KEYS = ["ipc_in", "ipc_out", "control"]


def path_of(octets, start="/run/"):
    return start + "x" * (octets - len(start.encode()))


def written(key, path):
    return path if key == "control" else f"ipc://{path}"


def mistakes(*overrides):
    with pytest.raises(ConfigurationError) as caught:
        captain_toml.load(None, overrides, "none")
    return caught.value.message.split("\n")


@pytest.mark.parametrize("key", KEYS)
@pytest.mark.parametrize("octets", [MOST + 1, 125, 3000])
def test_a_socket_path_of_more_than_107_octets_is_refused_with_its_length(key, octets):
    (line,) = mistakes(f"endpoint.{key}={written(key, path_of(octets))}")
    assert line.startswith(f'--set: endpoint.{key}: socket path too long: {octets} octets: "')
    assert line.endswith("; use at most 107")


@pytest.mark.parametrize("key", KEYS)
def test_the_octets_of_a_socket_path_are_counted_and_not_its_letters(key):
    path = path_of(MOST, "/run/\u00e9\u00e9/")
    assert len(path) == MOST - 2
    captain_toml.load(None, [f"endpoint.{key}={written(key, path)}"], "none")
    (line,) = mistakes(f"endpoint.{key}={written(key, path + 'x')}")
    assert "too long: 108 octets" in line


@pytest.mark.parametrize("start", ["ipc://@", "ipc://"])
def test_a_long_abstract_or_relative_name_is_refused_too(start):
    (line,) = mistakes(f"endpoint.ipc_in={start}{'x' * 108}")
    assert f"too long: {108 + start.count('@')} octets" in line


def test_both_paths_are_reported_at_once_with_any_other_mistake():
    long = path_of(MOST + 1)
    lines = mistakes(f"endpoint.ipc_in=ipc://{long}", f"endpoint.ipc_out=ipc://{long}y", "endpoint.pull=70000")
    assert [line.split(": ")[1] for line in lines] == ["endpoint.pull", "endpoint.ipc_in", "endpoint.ipc_out"]


def test_a_socket_path_of_107_octets_is_bound_and_one_of_108_is_refused_by_the_system():
    with tempfile.TemporaryDirectory(dir="/tmp") as folder, zmq.Context() as context:
        with context.socket(zmq.SUB) as socket:
            bind(socket, f"ipc://{path_of(MOST, folder + '/')}", "endpoint.ipc_in")
        with context.socket(zmq.SUB) as socket, pytest.raises(InterfaceError, match="File name too long"):
            bind(socket, f"ipc://{path_of(MOST + 1, folder + '/')}", "endpoint.ipc_in")


@pytest.mark.parametrize(
    "command",
    [
        ["status"],
        ["console", "--once"],
        ["selftest"],
        ["slot", "list"],
        ["board", "show"],
        ["time"],
        ["gnss", "status"],
    ],
    ids=lambda words: words[0],
)
def test_a_control_path_of_a_command_is_refused_with_its_length(command, capsys):
    with pytest.raises(SystemExit) as caught:
        cli.main([*command, "--control", path_of(125)])
    assert caught.value.code == 2
    assert '--control: socket path too long: 125 octets: "/run/xxx' in (said := capsys.readouterr().err)
    assert "use at most 107" in said


def test_a_default_control_path_that_is_too_long_is_reported_with_its_length():
    with closing(Loop()) as loop, pytest.raises(InterfaceError) as caught:
        ControlSocket(loop, path_of(125), None)
    assert caught.value.message.startswith('endpoint.control: socket path too long: 125 octets: "/run/xxx')
    assert "use at most 107" in caught.value.hint
    assert "choose another path with endpoint.control" in caught.value.hint


def test_a_temporary_folder_that_leaves_no_room_for_sockets_is_refused(monkeypatch, tmp_path):
    folder = tmp_path / ("x" * 100)
    folder.mkdir()
    monkeypatch.setenv("TMPDIR", str(folder))
    monkeypatch.setattr(tempfile, "tempdir", None)
    with pytest.raises(ConfigurationError) as caught:
        Scratch("captain-sim-")
    assert caught.value.message.startswith(f"TMPDIR too long: {len(str(folder))} octets: ")
    assert caught.value.hint.startswith("use at most ")
    assert list(folder.iterdir()) == []
