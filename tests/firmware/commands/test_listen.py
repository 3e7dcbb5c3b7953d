import json

import pytest

from drivers.message import Implausible, Position, RxInfo, Security, SecurityStatus
from firmware import cli
from firmware.client import client, listening
from firmware.client.received import Message
from firmware.client.show.tally import HEADS, Tally, cells, folded
from firmware.commands import listen
from tests.firmware.commands.fake import STATUS, FakeStation, Frames, delivered

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
RUBBISH: list[Frames] = [(b"message.cam.", b"{}", CAM), (b"message.",), (b"message.\xff\xfe", b"")]


def on_air(*messages: tuple[str, bytes]) -> FakeStation:
    return FakeStation(reports=[delivered(kind, pdu, rx=RX) for kind, pdu in messages])


def listened(station: FakeStation, *options: str) -> int:
    return cli.main(["listen", *station.options, *options])


def test_each_message_is_one_json_object_with_its_header_and_what_the_interface_knew(capsys):
    with on_air(("cam", CAM), ("denm", DENM)) as station:
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
    with FakeStation(reports=[delivered("cam", CAM)]) as station:
        assert listened(station, "--json", "--count", "1") == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["latitude"], found["longitude"], found["rssi_dbm"]) == (None, None, None)


def marked(*reasons: Implausible) -> FakeStation:
    reports = [delivered("cam", CAM, rx=RX._replace(implausible=reasons)), delivered("denm", DENM, rx=RX)]
    return FakeStation(reports=reports)


def test_a_marked_message_has_its_reasons_and_another_has_none(capsys):
    with marked(Implausible.TIME, Implausible.SOURCE) as station:
        assert listened(station, "--json", "--count", "2") == 0
    cam, other = map(json.loads, capsys.readouterr().out.splitlines())
    assert cam["implausible"] == ["time", "source"]
    assert "implausible" not in other


@pytest.mark.parametrize("options", [[], ["--headers"]])
def test_the_table_counts_marked_messages_with_their_reasons(capsys, options):
    with marked(Implausible.TIME, Implausible.OWN_ADDRESS) as station:
        assert listened(station, "--count", "2", *options) == 0
    assert "! 1 implausible: time, own-address" in capsys.readouterr().out


def test_a_message_of_a_short_pdu_without_a_name_shows_what_its_header_has(capsys):
    with on_air(("", b"\x02")) as station:
        assert listened(station, "--json", "--count", "1") == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["type"], found["octets"], found["hex"]) == ("", 1, "02")
    assert (found["station_id"], found["message_id"], found["protocol_version"]) == (None, None, 2)


def test_a_message_of_a_broker_has_no_mac_address(capsys):
    with FakeStation(reports=[delivered("cam", CAM, rx=RxInfo(source="cabin:1"))]) as station:
        assert listened(station, "--json", "--count", "1") == 0
    assert json.loads(capsys.readouterr().out)["source_mac"] == "00:00:00:00:00:00"


def gap() -> FakeStation:
    """A station of which the program misses the messages 2 to 4."""
    return FakeStation(reports=[delivered("cam", CAM, number) for number in (1, 5, 6)])


def test_missed_messages_are_in_the_next_object_of_their_type_and_their_sum_is_the_last_line(capsys):
    with gap() as station:
        assert listened(station, "--json", "--count", "3") == 0
    said = capsys.readouterr()
    assert [json.loads(line).get("missed") for line in said.out.splitlines()] == [None, 3, None]
    assert said.err == f"captain: 3 messages missed: {listen.CAUSES}\n"


def test_missed_messages_are_in_the_title_of_the_table(capsys):
    with gap() as station:
        assert listened(station, "--count", "3") == 0
    assert "3 messages in 0 s  3 missed\n" in capsys.readouterr().out


def test_a_station_of_an_older_release_is_refused_with_a_remedy(capsys):
    with FakeStation() as station:
        station.status = {key: value for key, value in STATUS.items() if key != "run"}
        assert listened(station) == 1
    said = capsys.readouterr().err
    assert "older release: it has no topic `message.`" in said
    assert "captain update" in said


def test_a_malformed_report_is_counted_and_the_next_message_passes(capsys):
    with FakeStation(reports=[*RUBBISH, delivered("cam", CAM)]) as station:
        assert listened(station, "--count", "1") == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "3 unreadable (last 6d6573736167652efffe)" in said
    assert "1337" in said


def test_only_the_wanted_types_are_shown(capsys):
    with on_air(("cam", CAM), ("denm", DENM)) as station:
        assert listened(station, "--json", "--type", "DENM", "--count", "1") == 0
    assert json.loads(capsys.readouterr().out)["type"] == "denm"


@pytest.mark.parametrize("wanted", ["200", "0200"])
def test_a_type_that_only_the_station_knows_is_wanted_by_its_message_id(wanted, capsys):
    own = bytes.fromhex("02c8000005390a")
    with on_air(("cam", CAM), ("mine", own), ("", own), ("denm", DENM)) as station:
        assert listened(station, "--json", "--type", wanted, "--type", "denm", "--count", "3") == 0
    found = [json.loads(line)["type"] for line in capsys.readouterr().out.splitlines()]
    assert found == ["mine", "", "denm"]


def test_a_pdu_too_short_for_a_message_id_has_none_that_is_wanted(capsys):
    with on_air(("", b"\x02"), ("cam", CAM)) as station:
        assert listened(station, "--json", "--type", "2", "--count", "1") == 0
    assert json.loads(capsys.readouterr().out)["type"] == "cam"


def test_messages_without_a_name_are_wanted_by_the_empty_one(capsys):
    with on_air(("cam", CAM), ("", DENM)) as station:
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
    with on_air(*[("cam", CAM)] * 3) as station:
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


def test_a_port_without_a_status_is_no_station(monkeypatch, capsys):
    monkeypatch.setattr(client, "ANSWER_S", 0.05)
    monkeypatch.setattr(listening, "REDRAW_S", 0.05)
    with FakeStation() as station:
        station.is_silent = True
        assert listened(station) == 1
    said = capsys.readouterr().err
    assert "no heartbeat and no status within" in said
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

    with open("/dev/null", "wb") as spare, on_air(("cam", CAM)) as station:
        monkeypatch.setattr("sys.stdout", Gone())
        assert listened(station, "--json") in (0, 141)
    monkeypatch.undo()
    assert capfd.readouterr().err == ""


def test_ctrl_c_is_the_shells_130(monkeypatch, capsys):
    def pressed(text: str, **_: object) -> None:
        raise KeyboardInterrupt

    with on_air(("cam", CAM)) as station:
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
