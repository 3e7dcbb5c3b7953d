import errno
import json
import os
import re
import socket

import pytest
from hypothesis import given
from hypothesis import strategies as st

from board.runtime.errors import StationError
from firmware import cli
from firmware.client import arguments, client
from firmware.client.show import table
from firmware.client.show.table import plain
from firmware.commands import status
from firmware.endpoint.control.control_socket import default_path, default_paths
from tests.firmware.commands.fake import STATUS, FakeControl, FakeStation
from tests.said import tells

NOW = 1795182430.0
STRANGER = 4_000_000  # a user's number

anything = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=8,
)


def shown(told: dict[str, object]) -> list[str]:
    return [line for table in status.tables(told, NOW) for line in [*plain(table, 80), ""]]


def test_a_status_fits_a_terminal_of_80_columns_and_24_lines():
    lines = shown(STATUS)
    assert max(map(len, lines)) <= 80
    assert len(lines) <= 32
    assert not any("\x1b" in line for line in lines)


def test_status_shows_links_queues_counters_and_drops_with_their_meaning():
    text = "\n".join(shown(STATUS))
    assert "fake: captain 0.1.0, profile standard, pid 4711, up 3 min" in text
    assert "g5         udp     up    3 min      1208     1  1/256   17      3" in text
    assert "g5: bound to 127.0.0.1:8947; started again 2 times" in text
    assert "g5     short-pdu      3  10 s       5  0202000005" in text
    assert f"short-pdu: {STATUS['drops'][0]['meaning']}" in text
    assert "duplicates within 2 s: 7 suppressed" in text


def test_implausible_messages_are_told_with_their_meaning_and_last_source():
    doubt = {"reason": "source", "meaning": "two senders", "count": 3, "time": NOW - 10, "source": "02:00:00:00:00:0a"}
    told = {"interfaces": {"g5": {**STATUS["interfaces"]["g5"], "implausible": [doubt]}}}
    lines = shown(STATUS | told)
    at = lines.index("implausible messages")
    assert lines[at + 1 : at + 4] == [
        "interface  reason  count   ago  last source",
        "g5         source      3  10 s  02:00:00:00:00:0a",
        "  source: two senders",
    ]
    assert "implausible messages" not in shown(STATUS)


def test_paths_are_told_for_each_station_type_and_interface():
    paths = [
        {"station": 4294967295, "type": "cam", "first": {"g5": 90, "v2n": 4}, "lead_ms": {"g5": 31.25, "v2n": 2.0},
         "alone": {"v2n": 12}},
        {"station": 7, "type": "", "first": {}, "lead_ms": {}, "alone": {"g5": 3}},
    ]  # fmt: skip
    told = STATUS["duplicates"] | {"paths": paths, "paths_kept": 40, "paths_forgotten": 5}
    lines = shown(STATUS | {"duplicates": told})
    at = lines.index("which interface was first, and messages of one interface alone")
    assert lines[at + 1 : at + 6] == [
        "station     type       interface  first  lead ms  alone",
        "4294967295  cam        g5            90     31.2      0",
        "                       v2n            4      2.0     12",
        "7           (no name)  g5             0               3",
        "  the last 2 of 40 that are kept; 5 forgotten",
    ]


def test_without_paths_nothing_is_said_of_them():
    assert not any("was first" in line for line in shown(STATUS))


@pytest.mark.parametrize(
    ("told", "line"),
    [
        ({"state": "kept", "refused": 0}, None),
        ({"state": "memory", "hint": "all is lost"}, "storage: /x is memory; all is lost"),
        (
            {"state": "kept", "hint": "make room", "refused": 2, "last_refusal": "/x/y: No space"},
            "storage: /x is kept; make room; 2 writes refused, the last: /x/y: No space",
        ),
        (
            {"state": "kept", "hint": "", "refused": 2, "last_refusal": "/x/y: No space"},
            "storage: /x is kept again; 2 writes were refused, the last: /x/y: No space",
        ),
    ],
)
def test_a_folder_for_state_is_told_where_something_is_not_kept(told, line):
    assert [text for text in shown({"storage": {"folder": "/x", **told}}) if "storage" in text] == (
        [line] if line else []
    )


@pytest.mark.parametrize(
    ("told", "words"),
    [
        ({"is_running": True, "trouble": ""}, []),
        (
            {"is_running": True, "trouble": "No space left on device", "lost": 7},
            ["recorder: /x: No space left on device; 7 frames lost"],
        ),
        (
            {"is_running": True, "not_kept": 2},
            ["recorder: 2 events not kept whole: raise recorder.size_mb"],
        ),
        ({"is_running": False, "why": "process 7 ended"}, ["recorder: it does not run: process 7 ended"]),
    ],
)
def test_a_recorder_in_trouble_is_told(told: dict[str, object], words: list[str]) -> None:
    assert [text for text in shown({"recorder": {"folder": "/x", **told}}) if "recorder" in text] == words


def test_unverified_delivery_is_reported_in_one_line_while_there_is_any():
    told = {"verifies": False, "unverified": "deliver", "delivered": 17}
    text = " ".join(line.strip() for line in shown(STATUS | {"security": told}))
    assert tells(text, "security: ", "not verified", "17 signed messages", "unverifiable-pkt")
    assert shown(STATUS | {"security": told | {"delivered": 0}}) == shown(STATUS)


def test_a_slow_subscriber_is_told_where_it_is():
    slow = {"slow_since": NOW, "slow_count": 3}
    titles = {
        place: [table.title for table in status.tables(STATUS | {place: slow}, NOW)] for place in ("endpoint", "report")
    }
    words = r"; a subscriber is slow since \d\d:\d\d:\d\d, time 3"
    assert any(re.fullmatch(rf"users: .*{words}", title) for title in titles["endpoint"])
    assert any(re.fullmatch(rf"reports{words}", title) for title in titles["report"])
    assert "slow" not in "\n".join(shown(STATUS))


@given(st.dictionaries(st.sampled_from(sorted(STATUS)), anything))
def test_whatever_a_peer_calls_its_status_is_shown(told):
    lines = shown(told)
    assert all(len(line) <= 80 and (line.isprintable() or not line) for line in lines)


@given(st.sampled_from(sorted(STATUS)), st.text(max_size=8), anything)
def test_one_odd_value_does_not_hide_the_rest(key, name, value):
    inner = STATUS[key]
    told = STATUS | {key: inner | {name: value} if isinstance(inner, dict) else value}
    assert len(shown(told)) > 8


def test_a_station_elsewhere_is_asked_over_its_report_port(capsys):
    with FakeStation() as station:
        assert cli.main(["status", "--json", *station.options]) == 0
    assert json.loads(capsys.readouterr().out) == STATUS


def test_rubbish_before_the_status_is_skipped(capsys):
    reports = [(b"status.",), (b"status.", b"{"), (b"status.", b"[1]"), (b"\xff", b"\xff"), (b"", b"", b"")]
    with FakeStation() as station:
        station._reports = reports
        assert cli.main(["status", *station.options]) == 0
    assert "fake: captain 0.1.0" in capsys.readouterr().out


def test_a_station_of_this_machine_is_asked_over_its_control_socket(tmp_path, capsys):
    answer = json.dumps({"ok": True, "status": STATUS}).encode() + b"\n"
    with FakeControl(tmp_path / "control", answer) as control:
        assert cli.main(["status", "--json", "--control", str(control.path)]) == 0
    assert json.loads(capsys.readouterr().out) == STATUS
    assert control.lines == [b'{"do": "status"}\n']


def test_the_control_socket_is_found_by_the_first_port(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    answer = json.dumps({"ok": True, "status": STATUS}).encode() + b"\n"
    with FakeControl(tmp_path / "captain-5999.sock", answer):
        assert cli.main(["status", "--station", ":5999"]) == 0
    assert "fake: captain" in capsys.readouterr().out


@pytest.mark.parametrize("runtime", [True, False])
def test_a_station_listens_where_its_command_line_looks(tmp_path, monkeypatch, runtime):
    if runtime:
        monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    else:
        monkeypatch.delenv("XDG_RUNTIME_DIR", raising=False)
    assert default_path(5555) in default_paths(5555)


@pytest.mark.parametrize(
    ("mode", "user", "is_believed"),
    [
        (0o1777, STRANGER, False),
        (0o1777, 0, True),
        (0o1777, os.getuid(), True),
        (0o755, STRANGER, True),
    ],
)
def test_a_stranger_in_a_folder_of_everybody_is_not_believed(tmp_path, monkeypatch, capsys, mode, user, is_believed):
    # Only root could really listen as somebody else.
    monkeypatch.setattr(socket.socket, "getsockopt", lambda *_: client.control_socket.PEER.pack(1, user, user))
    tmp_path.chmod(mode)
    answer = json.dumps({"ok": True, "status": STATUS}).encode() + b"\n"
    with FakeControl(tmp_path / "control", answer) as control:
        assert cli.main(["status", "--control", str(control.path)]) == (0 if is_believed else 1)
    assert (f"belongs to user {STRANGER}" in capsys.readouterr().err) is not is_believed
    assert any(control.lines) is is_believed


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        (b'{"ok": false, "error": "busy", "hint": "wait"}\n', "refused `status`: busy\n  (wait)"),
        (b"not JSON\n", "the program that answers there is not a station"),
        (b"[]\n", "the program that answers there is not a station"),
        (b'{"ok": true}\n', "the answer holds no status"),
        (b"", "the program that answers there is not a station"),
        (b"[" * 100_000 + b"\n", "the program that answers there is not a station"),
    ],
)
def test_a_strange_answer_of_the_control_socket_is_explained(tmp_path, capsys, answer, words):
    with FakeControl(tmp_path / "control", answer) as control:
        assert cli.main(["status", "--control", str(control.path)]) == 1
    assert words in capsys.readouterr().err


def test_status_without_a_control_socket_fails_with_captain_run(tmp_path, capsys):
    assert cli.main(["status", "--control", str(tmp_path / "nothing")]) == 1
    said = capsys.readouterr().err
    assert tells(said, f"{tmp_path}/nothing: ", "no station", f": {os.strerror(errno.ENOENT)}")
    assert "captain run" in said


def test_watching_over_the_control_socket_asks_again_and_again(tmp_path, monkeypatch, capsys):
    waited = []

    def sleep(seconds: float) -> None:
        waited.append(seconds)
        if len(waited) == 3:
            raise KeyboardInterrupt

    monkeypatch.setattr(status.time, "sleep", sleep)
    answer = json.dumps({"ok": True, "status": STATUS}).encode() + b"\n"
    with FakeControl(tmp_path / "control", answer) as control:
        assert cli.main(["status", "--watch", "--json", "--control", str(control.path)]) == 130
    assert [json.loads(line) for line in capsys.readouterr().out.splitlines()] == [STATUS] * 3
    assert waited == [1.0] * 3


@pytest.mark.parametrize("place", ["control", ""])
def test_a_right_that_is_missing_is_told_with_whose_the_socket_is(tmp_path, monkeypatch, capsys, place):
    # The tests may run as root, whom nothing is denied.
    def exchange(path: str, line: bytes, timeout_s: float) -> bytes:
        raise PermissionError(errno.EACCES, "Permission denied")

    socket_path = tmp_path / "control"
    socket_path.touch()
    denied = tmp_path / place
    denied.chmod(0o710)
    monkeypatch.setattr(client.control_socket, "exchange", exchange)
    monkeypatch.setattr(client.os, "access", lambda path, way: path != denied)
    assert cli.main(["status", "--control", str(socket_path)]) == 1
    said = capsys.readouterr().err
    assert f"{socket_path}: permission denied: {denied} is of user {denied.owner()}, " in said
    assert f"group {denied.group()}, mode 0710" in said
    assert f"ask as user {denied.owner()}" in said
    assert "captain run" not in said


def test_station_whose_control_socket_is_elsewhere_is_not_reported_as_absent(capsys):
    with socket.create_server(("127.0.0.1", 0)) as there:
        port = there.getsockname()[1]
        assert cli.main(["slot", "list", "--station", f"127.0.0.1:{port}"]) == 1
    said = capsys.readouterr().err
    assert tells(said, "station may ", f"port {port}")
    assert "--control PATH" in said


def test_status_from_a_closed_port_fails_with_captain_run(capsys):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))  # bound, not listening: refuses
        port = taken.getsockname()[1]
        assert cli.main(["status", "--report", str(port), "--station", "127.0.0.1:1"]) == 1
    said = capsys.readouterr().err
    assert tells(said, "no station ", f" 127.0.0.1:{port}")
    assert "captain run" in said
    assert "first of its four ports" in said


def test_station_with_the_second_port_is_refused_with_a_remedy_on_ports(block, capsys):
    with socket.create_server(("127.0.0.1", block)):
        assert cli.main(["listen", "--station", f":{block + 1}"]) == 1
    assert "first of its four ports" in " ".join(capsys.readouterr().err.split())


@pytest.mark.parametrize("host", ["a" * 80, ".."])
def test_station_with_an_invalid_host_is_refused_with_a_remedy(capsys, host):
    assert cli.main(["status", "--station", host]) == 1
    said = capsys.readouterr().err
    assert tells(said, "no station ", host, "host name")


def test_station_with_an_unknown_host_is_refused_with_a_remedy(monkeypatch, capsys):
    def unknown(*_: object) -> None:
        raise socket.gaierror(socket.EAI_NONAME, "Name or service not known")

    monkeypatch.setattr(client.socket, "create_connection", unknown)
    assert cli.main(["status", "--station", "nosuchhost"]) == 1
    said = capsys.readouterr().err
    assert tells(said, "nosuchhost", "host name")
    assert "captain run" not in said


@pytest.mark.parametrize(
    ("text", "remedy"),
    [("tcp://127.0.0.1:5565", "write HOST:PORT without tcp://"), ("5565", "write :5565")],
)
def test_station_in_another_form_is_refused_with_the_right_one(text, remedy, capsys):
    with pytest.raises(SystemExit) as ended:
        cli.main(["status", "--station", text])
    assert ended.value.code == 2
    assert remedy in capsys.readouterr().err


def test_a_listener_that_is_no_station_ends_in_a_message_and_not_in_waiting(monkeypatch, capsys):
    monkeypatch.setattr(client, "ANSWER_S", 0.05)
    monkeypatch.setattr(client.next_report, "__defaults__", (0.05,))
    monkeypatch.setattr(client.status, "__defaults__", ("", 0.05))
    with socket.create_server(("127.0.0.1", 0)) as mute:
        port = mute.getsockname()[1]
        assert cli.main(["status", "--report", str(port), "--station", "127.0.0.1:1"]) == 1
    assert "no status within 0.05 s" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("box", ("box", 5555)),
        ("box:", ("box", 5555)),
        ("10.0.0.1:6000", ("10.0.0.1", 6000)),
        (":6000", ("127.0.0.1", 6000)),
        ("[::1]:6000", ("::1", 6000)),
        ("::1", ("::1", 5555)),
    ],
)
def test_a_station_is_named_by_host_and_first_port(text, expected):
    assert arguments.station(text) == expected


@pytest.mark.parametrize("text", ["box:0", "box:65533", "box:70000", "box:x", "box:-1", "box:٣", "[::1]6000x"])
def test_a_port_that_cannot_be_is_wrong_usage(text):
    with pytest.raises(SystemExit) as ended:
        cli.main(["status", "--station", text])
    assert ended.value.code == 2


@given(st.lists(st.binary(max_size=40), max_size=4))
def test_no_report_of_a_peer_is_fatal(frames):
    report = client.parse_report(frames)
    assert report is None or isinstance(report[1], dict)


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0, "0.0 s"), (9.96, "10.0 s"), (42, "42 s"), (192, "3 min"), (7200, "2 h"), (864_000, "10 d")],
)
def test_a_span_is_short(seconds, text):
    assert table.span(seconds) == text


def test_detail_of_the_last_drop_is_shown_below_the_reasons():
    (drop,) = STATUS["drops"]
    detail = "the broker has no room"
    lines = shown(STATUS | {"drops": [drop | {"detail": detail}]})
    assert f"  g5, the last short-pdu: {detail}" in lines
    assert not any("the last short-pdu" in line for line in shown(STATUS))


@pytest.mark.parametrize(
    ("do", "more", "error", "told"),
    [
        ("slot", {"ask": "off", "slot": "9"}, "slot: '9' is not known", "refused `slot off 9`: '9' is not known"),
        ("operate", {"interface": "5g", "ask": "at", "arguments": {}}, "ERROR", "refused `5g at`: ERROR"),
        ("board", {}, "it is busy", "refused `board`: it is busy"),
    ],
)
def test_what_a_station_refuses_is_told_in_the_words_of_who_asked(tmp_path, do, more, error, told):
    answer = json.dumps({"ok": False, "error": error, "hint": "one of 1, 2"}).encode() + b"\n"
    with FakeControl(tmp_path / "control", answer) as control, pytest.raises(StationError) as caught:
        client.ask(control.path, do, 3.0, **more)
    assert (caught.value.message, caught.value.hint) == (f"the station {told}", "one of 1, 2")


def test_what_is_wrong_is_told_before_what_is_long():
    slots = {"slots": {f"s{at}": {"number": at, "state": "running"} for at in range(1, 5)}, "complaints": []}
    text = "\n".join(shown(STATUS | {"board": {"name": "sim"} | slots}))
    heads = ["interfaces", "drops", "users", "duplicates", "policy", "slots", "messages"]
    places = [text.index(f"\n{head}") for head in heads]
    assert places == sorted(places)
    assert text[: places[heads.index("slots")]].count("\n") < 24
