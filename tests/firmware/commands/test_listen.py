import json
import socket

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.message import Position, RxInfo, Security, SecurityStatus
from drivers.wire import raw
from firmware import cli
from firmware.client import client, listening
from firmware.client.received import Message, Pairing
from firmware.client.show.tally import HEADS, Tally, cells, folded
from firmware.endpoint.report import digest_of
from tests.firmware.commands.fake import FakeStation

CAM = bytes.fromhex("02020000053900010203")
DENM = bytes.fromhex("0201000005390a")
RX = RxInfo(
    rssi_dbm=-71,
    data_rate=12,
    traffic_class=2,
    hop_limit=1,
    position=Position(470585000, 154600000),
    source_mac=bytes.fromhex("010203040506"),
    security=Security(SecurityStatus.UNVERIFIABLE_PKT),
)
RECEIVED_NS = 1795182426_461613000


def on_air(kind: str, pdu: bytes) -> list[tuple[bytes, bytes]]:
    return [(b"raw.", raw.build(pdu, RECEIVED_NS, RX)), (b"v2x.%s." % kind.encode(), pdu)]


RUBBISH = [(b"raw.", b"\xff\xff"), (b"hello",), (b"v2x.", b""), (b"a", b"b", b"c"), (b"\xff\xfe", b"")]


def listened(station: FakeStation, *options: str) -> int:
    return cli.main(["listen", *station.options, *options])


def test_each_message_is_one_json_object_with_its_header_and_what_the_interface_knew(capsys):
    with FakeStation(on_air("cam", CAM) + on_air("denm", DENM)) as station:
        assert listened(station, "--json", "--count", "2") == 0
    cam, denm = map(json.loads, capsys.readouterr().out.splitlines())
    assert cam == {
        "type": "cam",
        "station_id": 1337,
        "message_id": 2,
        "protocol_version": 2,
        "octets": 10,
        "received": 1795182426.461613,
        "rssi_dbm": -71,
        "data_rate": 12,
        "traffic_class": 2,
        "hop_limit": 1,
        "source_mac": "01:02:03:04:05:06",
        "security": "unverifiable_pkt",
        "latitude": 47.0585,
        "longitude": 15.46,
        "hex": CAM.hex(),
    }
    assert (denm["type"], denm["hex"]) == ("denm", DENM.hex())


def test_an_unknown_position_of_a_message_is_null(capsys):
    with FakeStation([(b"raw.", raw.build(CAM, RECEIVED_NS, RxInfo())), (b"v2x.cam.", CAM)]) as station:
        assert listened(station, "--json", "--count", "1") == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["latitude"], found["longitude"], found["rssi_dbm"]) == (None, None, None)


def mark(pdu: bytes, *reasons: str, received_ns: int = RECEIVED_NS) -> tuple[bytes, bytes]:
    said = {"digest": digest_of(pdu), "received_ns": received_ns, "implausible": reasons}
    return b"implausible.cam.", json.dumps(said).encode()


def marked(*reports: tuple[bytes, ...]) -> FakeStation:
    return FakeStation(on_air("cam", CAM) + on_air("denm", DENM), reports)


def shown(station: FakeStation, capsys, wanted: str, *options: str) -> str:
    """Return the output once it has the wanted text: marks have a connection of their own, and may come later."""
    for _ in range(1000):
        assert listened(station, *options) == 0
        if wanted in (said := capsys.readouterr().out):
            return said
    raise AssertionError(said)


def test_a_marked_message_has_its_reasons_and_another_has_none(capsys):
    with marked(mark(CAM, "time", "source")) as station:
        said = shown(station, capsys, "implausible", "--json", "--count", "2")
    cam, other = map(json.loads, said.splitlines())
    assert cam["implausible"] == ["time", "source"]
    assert "implausible" not in other


@pytest.mark.parametrize("options", [[], ["--headers"]])
def test_the_table_counts_marked_messages_with_their_reasons(capsys, options):
    with marked(mark(CAM, "time", "own-address")) as station:
        said = shown(station, capsys, "implausible", "--count", "2", *options)
    assert "! 1 implausible: time, own-address" in said


def test_without_a_report_port_messages_come_unmarked(capsys):
    with socket.create_server(("127.0.0.1", 0)) as once, FakeStation(on_air("cam", CAM)) as station:
        nobody = once.getsockname()[1]
        once.close()
        assert listened(station, "--json", "--count", "1", "--report", str(nobody)) == 0
    assert "implausible" not in json.loads(capsys.readouterr().out)


def test_a_message_without_raw_still_shows_its_header(capsys):
    with FakeStation([(b"v2x..", b"\x02")]) as station:
        assert listened(station, "--json", "--count", "1") == 0
    found = json.loads(capsys.readouterr().out)
    assert found == {
        "type": "",
        "station_id": None,
        "message_id": None,
        "protocol_version": 2,
        "octets": 1,
        "hex": "02",
    }


def test_rubbish_is_counted_and_the_next_message_passes(capsys):
    with FakeStation([*RUBBISH, *on_air("cam", CAM)]) as station:
        assert listened(station, "--count", "1") == 0
    said = capsys.readouterr().out
    assert "5 unreadable (last fffe)" in said
    assert "1337" in said


def test_only_the_wanted_types_are_shown(capsys):
    with FakeStation(on_air("cam", CAM) + on_air("denm", DENM)) as station:
        assert listened(station, "--json", "--type", "DENM", "--count", "1") == 0
    assert json.loads(capsys.readouterr().out)["type"] == "denm"


@pytest.mark.parametrize("wanted", ["200", "0200"])
def test_a_type_that_only_the_station_knows_is_wanted_by_its_message_id(wanted, capsys):
    own = bytes.fromhex("02c8000005390a")
    named = [(b"v2x.mine.", own), (b"v2x..", own)]
    with FakeStation([*on_air("cam", CAM), *named, *on_air("denm", DENM)]) as station:
        assert listened(station, "--json", "--type", wanted, "--type", "denm", "--count", "3") == 0
    found = [json.loads(line)["type"] for line in capsys.readouterr().out.splitlines()]
    assert found == ["mine", "", "denm"]


def test_a_pdu_too_short_for_a_message_id_has_none_that_is_wanted(capsys):
    with FakeStation([(b"v2x..", b"\x02"), *on_air("cam", CAM)]) as station:
        assert listened(station, "--json", "--type", "2", "--count", "1") == 0
    assert json.loads(capsys.readouterr().out)["type"] == "cam"


def test_messages_without_a_name_are_wanted_by_the_empty_one(capsys):
    with FakeStation([*on_air("cam", CAM), *on_air("", DENM)]) as station:
        assert listened(station, "--json", "--type", "", "--count", "1") == 0
    assert json.loads(capsys.readouterr().out)["hex"] == DENM.hex()


@pytest.mark.parametrize(
    ("wanted", "remedy"),
    [
        ("foo", "'foo': unknown type; known: denm, cam, poi, "),
        ("dnem", "'dnem': unknown type; did you mean denm?"),
        ("SPAT", "'SPAT': unknown type; did you mean spatem?"),
        ("cam.", "'cam.': unknown type; did you mean cam?"),
        ("256", "'256': messageID out of range; 0 to 255"),
        ("9" * 5000, ": messageID out of range; 0 to 255"),
        ("\u0662", ": unknown type; known: "),
        ("-1", ": unknown type; known: "),
    ],
)
def test_a_type_that_does_not_exist_is_wrong_usage_with_a_remedy(wanted, remedy, capsys):
    with pytest.raises(SystemExit) as ended:
        cli.main(["listen", f"--type={wanted}"])
    assert ended.value.code == 2
    assert remedy in capsys.readouterr().err


def test_without_a_terminal_the_table_is_plain_text(capsys):
    with FakeStation(on_air("cam", CAM) * 3) as station:
        assert listened(station, "--headers", "--count", "3") == 0
    said = capsys.readouterr().out
    assert "\x1b" not in said
    assert "type  station  count  per s  octets  dBm" in said
    assert "cam      1337      3             10  -71" in said
    assert said.endswith(" s\n")


def test_a_duration_ends_it_though_nothing_comes(capsys):
    with FakeStation() as station:
        assert listened(station, "--duration", "0.05") == 0
    assert "0 messages in" in capsys.readouterr().out


def test_a_port_without_heartbeat_is_no_station(monkeypatch, capsys):
    monkeypatch.setattr(client, "ANSWER_S", 0.05)
    monkeypatch.setattr(listening, "REDRAW_S", 0.05)
    with FakeStation() as station:
        station.is_silent = True
        assert listened(station) == 1
    said = capsys.readouterr().err
    assert "no heartbeat" in said
    assert "the first of its four ports" in said


def test_a_reader_who_leaves_ends_it_without_a_word(monkeypatch, capfd):
    class Gone:
        def write(self, text: str) -> int:
            raise BrokenPipeError

        def flush(self) -> None:
            raise BrokenPipeError

        def isatty(self) -> bool:
            return False

        def fileno(self) -> int:
            return spare.fileno()

    with open("/dev/null", "wb") as spare, FakeStation(on_air("cam", CAM)) as station:
        monkeypatch.setattr("sys.stdout", Gone())
        assert listened(station, "--json") in (0, 141)
    monkeypatch.undo()
    assert capfd.readouterr().err == ""


def test_ctrl_c_is_the_shells_130(monkeypatch, capsys):
    def pressed(text: str, **_: object) -> None:
        raise KeyboardInterrupt

    with FakeStation(on_air("cam", CAM)) as station:
        monkeypatch.setattr("builtins.print", pressed)
        assert listened(station, "--json") == 130


@pytest.mark.parametrize(
    "options",
    [["--count", "0"], ["--count", "x"], ["--duration", "0"], ["--duration", "nan"], ["--duration", "inf"]],
)
def test_an_impossible_end_is_wrong_usage(options):
    with pytest.raises(SystemExit) as ended:
        cli.main(["listen", *options])
    assert ended.value.code == 2


@given(st.lists(st.lists(st.binary(max_size=200) | st.sampled_from([b"raw.", b"v2x.cam.", b"v2x."]), max_size=4)))
def test_no_message_of_a_peer_is_fatal(messages):
    pairing = Pairing()
    taken = [pairing.feed(frames) for frames in messages]
    assert all(message is None or isinstance(message, Message) for message in taken)
    assert pairing.rubbish <= len(messages)
    assert len(pairing.sample) <= 32


def test_what_the_interface_knew_is_never_given_to_another_message():
    pairing = Pairing()
    pairing.feed([b"raw.", raw.build(CAM, RECEIVED_NS, RX)])
    assert pairing.feed([b"v2x.denm.", DENM]).raw is None
    assert pairing.feed([b"v2x.cam.", CAM]).raw is None


def test_heartbeats_are_no_messages():
    pairing = Pairing()
    assert pairing.feed([b"hb.counter", b'{"heartbeat_counter": 0}']) is None
    assert pairing.rubbish == 0


def message_of(station: int, kind: str = "cam", octets: int = 10) -> Message:
    return Message(kind, bytes([2, 2]) + station.to_bytes(4) + bytes(octets - 6), None)


def test_a_million_stations_do_not_grow_the_table_and_none_is_lost_from_the_sum():
    tally = Tally(most=8)
    for station in range(10_000):
        tally.add(message_of(station), float(station))
    rows = tally.rows()
    assert len(rows) == 9
    assert rows[-1].station == "others"
    assert sum(row.count for row in rows) == tally.total == 10_000


def test_the_station_silent_longest_gives_its_place():
    tally = Tally(most=2)
    for station in (1, 2, 1, 3):
        tally.add(message_of(station), 0.0)
    assert [row.station for row in tally.rows()] == [1, 3, "others"]


def test_rows_beyond_the_screen_are_folded_but_kept():
    tally = Tally()
    for station in range(5):
        tally.add(message_of(station, octets=10 + station), 1.0)
    shown = folded(tally.rows(), 3)
    assert [(row.station, row.count) for row in shown] == [(0, 1), (1, 1), ("others", 3)]
    assert (shown[-1].shortest, shown[-1].longest) == (12, 14)
    assert len(tally.rows()) == 5
    assert folded(tally.rows(), 5) == tally.rows()


def test_rows_keep_their_order_whoever_is_heard_last():
    tally = Tally()
    for kind, station in (("cam", 9), ("own", 1), ("denm", 9), ("cam", 3), ("mapem", 9), ("cam", 9), ("denm", 2)):
        tally.add(message_of(station, kind), 1.0)
    wanted = [("denm", 2), ("denm", 9), ("mapem", 9), ("cam", 3), ("cam", 9), ("own", 1)]
    assert [(row.type, row.station) for row in tally.rows()] == wanted


def test_a_rate_is_a_mean_over_the_last_marks():
    tally = Tally()
    for tenth in range(101):
        now = tenth / 10
        if tenth and tenth % 10 == 0:
            tally.mark(now)
        tally.add(message_of(1), now)
    assert tally.rows()[0].rate(10.0) == pytest.approx(10.0, rel=0.05)


def test_a_type_of_a_peer_cannot_move_the_cursor():
    tally = Tally()
    tally.add(message_of(1, kind="\x1b[2J"), 0.0)
    from firmware.client.show.table import Table, plain

    rows = [cells(row, 1.0) for row in tally.rows()]
    assert "\x1b" not in "\n".join(plain(Table("", HEADS, rows), 80))


def test_the_age_of_a_row_counts_from_its_last_message():
    tally = Tally()
    tally.add(message_of(1), 5.0)
    assert cells(tally.rows()[0], 7.25)[-1] == "2.2 s"
