"""A handler at work: what it passes on to either side, counts and says."""

from types import SimpleNamespace

import pytest

from firmware.gateway.captain_gateway.captain_gateway import channel, diagnosis, lists
from firmware.gateway.captain_gateway.captain_gateway.channel import Channel
from firmware.gateway.captain_gateway.captain_gateway.codec import Edition
from firmware.gateway.captain_gateway.captain_gateway.counts import Complaints, Counts
from firmware.gateway.captain_gateway.captain_gateway.errors import RefusedError
from firmware.gateway.captain_gateway.captain_gateway.filters import ITS_EPOCH_S
from firmware.gateway.captain_gateway.captain_gateway.handlers import KINDS
from firmware.gateway.captain_gateway.captain_gateway.pairing import Arrival
from firmware.gateway.captain_gateway.captain_gateway.settings import HANDLER, receive, transmit
from tests.firmware.gateway.library import HEAD, Library
from tests.firmware.gateway.real import CAM
from tests.said import tells

DEFAULTS = {name: option.default for name, option in HANDLER.items()}
LATER = CAM[:6] + b"\1\2" + CAM[8:]  # its generationDeltaTime
ARRIVAL = Arrival("cam", CAM, None)


class Topic:
    """A publisher."""

    def __init__(self, subscriptions: int = 1) -> None:
        self.said: list[bytes] = []
        self.subscriptions = subscriptions

    def publish(self, octets: bytes) -> None:
        self.said.append(octets)

    def get_subscription_count(self) -> int:
        return self.subscriptions


class Bench:
    def __init__(self, name: str = "cam") -> None:
        kind = KINDS[name]
        self.lines: list[str] = []
        self.sent: list[tuple[bytes, dict[str, object], str]] = []
        self.has_station = True
        self.channel = Channel(
            kind, Edition(Library(), kind.editions[0], "etsi_its", kind), receive(DEFAULTS), transmit(DEFAULTS),
            SimpleNamespace(place=None, leap_seconds=5), Complaints(60.0), self.lines.append,
        )  # fmt: skip
        self.channel.publisher, self.channel.metadata = Topic(), Topic()
        self.channel.send = self.send

    def send(self, channel: Channel, pdu: bytes, asked: dict[str, object], label: str) -> None:
        if not self.has_station:
            raise RefusedError("no-station", "no station takes messages at tcp://127.0.0.1:5557")
        self.sent.append((pdu, asked, label))

    def set(self, **chosen: object) -> None:
        values = DEFAULTS | {name.replace("__", "."): value for name, value in chosen.items()}
        self.channel.receiving = receive(values)
        self.channel.set_transmitting(transmit(values))


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_a_received_message_is_published_as_it_is_and_noted(bench):
    note = bench.channel.receive(ARRIVAL)
    assert bench.channel.publisher.said == [HEAD + CAM]
    assert note is not None
    assert (note.sequence, note.pdu, note.edition) == (1, CAM, "cam-1.4.1")
    assert (bench.channel.counts.received, bench.channel.counts.published) == (1, 1)


VERSION_1 = bytes.fromhex(
    "010200000001c41e005a97ac450dd00a399ffffffc23b7743e00d2afc14dfe3fe9ed0733b590303600"
)  # CAM V1.3.2 of a made value, curvature 386; V1.4.1 reads -74


def test_a_received_message_of_another_edition_is_not_published_and_its_edition_is_named(bench):
    assert bench.channel.receive(Arrival("cam", VERSION_1, None)) is None
    assert bench.channel.publisher.said == []
    assert bench.channel.counts.not_published == {"edition": 1}
    (line,) = bench.lines
    assert "header.protocol_version: 1 selects cam-1.3.2, not cam-1.4.1" in line


def test_an_inactive_handler_decodes_nothing(bench, monkeypatch):
    bench.set(receive__active=False)
    monkeypatch.setattr(Edition, "of", lambda *_: pytest.fail("decoded"))
    assert bench.channel.receive(ARRIVAL) is None
    assert bench.channel.counts.not_published == {"inactive": 1}


def test_an_edition_that_the_routing_has_found_is_not_looked_for_again(bench, monkeypatch):
    monkeypatch.setattr(Edition, "of", lambda *_: pytest.fail("decoded"))
    assert bench.channel.receive(ARRIVAL, bench.channel.edition).edition == "cam-1.4.1"


def test_message_that_another_edition_reads_otherwise_is_published_and_doubted():
    bench = Bench("vam")
    vam = bytes.fromhex("031000001267ce004137480ef6c6b49d2000004dd1c2148d5b0006ea6afffb98031010")
    assert bench.channel.receive(Arrival("vam", vam, None)) is not None
    assert bench.channel.counts.doubtful == 1
    (line,) = bench.lines
    assert tells(line, "published as vam-2.1.1", "vam-2.3.1 ", "different values: 0310")


def test_nothing_is_noted_while_nobody_wants_to_know_but_the_sequence_goes_on(bench):
    bench.channel.metadata.subscriptions = 0
    assert bench.channel.receive(ARRIVAL) is None
    bench.channel.metadata.subscriptions = 1
    assert bench.channel.receive(ARRIVAL).sequence == 2


@pytest.mark.parametrize(
    ("chosen", "cause"),
    [
        ({"receive__active": False}, "inactive"),
        ({"receive__stations": [1]}, "station"),
        ({"receive__area": [0.0, 0.0, 1.0]}, "area"),
    ],
)
def test_what_is_filtered_is_counted_by_why_and_not_complained_of(bench, chosen, cause):
    bench.set(**chosen)
    assert bench.channel.receive(ARRIVAL) is None
    assert bench.channel.counts.not_published == {cause: 1}
    assert bench.channel.publisher.said == []
    assert bench.lines == []


@pytest.mark.parametrize(("later_s", "not_published"), [(0.9, {}), (1.1, {"age": 1})])
def test_a_message_of_long_ago_is_filtered_by_its_age(bench, monkeypatch, later_s, not_published):
    # Its generationDeltaTime is 51136 ms of 65536; so is this second of Unix time.
    generated_s = ITS_EPOCH_S - 5 + (65536 * 10_000_000 + 51136) / 1000
    monkeypatch.setattr(channel.time, "time", lambda: generated_s + later_s)
    bench.set(receive__max_age_s=1.0)
    bench.channel.receive(ARRIVAL)
    assert bench.channel.counts.not_published == not_published


@pytest.mark.parametrize("filtered", [{}, {"receive__area": [0.0, 0.0, 1.0]}])
def test_a_message_that_does_not_decode_is_counted_and_explained(bench, filtered):
    bench.set(**filtered)
    bench.channel.receive(Arrival("cam", CAM[:30], None))
    assert bench.channel.counts.not_published == {"undecodable": 1}
    assert "bit" in bench.lines[0]
    assert bench.lines[0].startswith("cam/received: not published: ")


def test_a_message_of_ros_goes_to_the_station_at_once(bench):
    bench.channel.transmit(HEAD + CAM)
    assert bench.sent == [(CAM, {}, "")]
    assert (bench.channel.counts.taken, bench.channel.counts.sent) == (1, 1)


def test_what_is_asked_for_one_message_goes_before_the_parameters(bench):
    bench.set(transmit__priority=3, transmit__lifetime_s=2.0)
    bench.channel.hand_over(CAM, {"priority": 0}, "mine")
    assert bench.sent == [(CAM, {"priority": 0, "lifetime_s": 2.0}, "mine")]


def test_the_own_station_id_is_put_into_what_is_sent(bench):
    bench.channel.station_id = 99
    bench.channel.transmit(HEAD + CAM)
    assert bench.sent[0][0] == CAM[:2] + b"\0\0\0\x63" + CAM[6:]


@pytest.mark.parametrize(
    ("cdr", "cause"), [(HEAD + CAM[:30], "out-of-range"), (b"", "foreign"), (HEAD + b"\2\1" + CAM[2:], "header")]
)
def test_what_cannot_be_sent_is_counted_and_explained_and_not_sent(bench, cdr, cause):
    bench.channel.transmit(cdr)
    assert bench.sent == []
    assert bench.channel.counts.not_sent == {cause: 1}
    assert bench.lines[0].startswith("cam/transmitted: not sent: ")
    assert bench.channel.counts.why_not_sent in bench.lines[0]


def test_the_same_complaint_is_made_once_in_a_while(bench):
    for _ in range(5):
        bench.channel.transmit(b"")
    assert len(bench.lines) == 1
    assert bench.channel.counts.not_sent == {"foreign": 5}


def test_without_a_station_a_message_is_counted_as_not_sent(bench):
    bench.has_station = False
    bench.channel.transmit(HEAD + CAM)
    assert bench.channel.counts.not_sent == {"no-station": 1}
    assert bench.channel.counts.sent == 0


def test_an_inactive_handler_sends_nothing_and_complains_of_nothing(bench):
    bench.set(transmit__active=False)
    bench.channel.transmit(HEAD + CAM)
    assert (bench.sent, bench.lines) == ([], [])
    assert bench.channel.counts.not_sent == {"inactive": 1}


def test_with_a_rate_the_latest_of_each_station_goes_in_a_period(bench):
    bench.set(transmit__rate_hz=10.0)
    other = CAM[:2] + b"\0\0\0\7" + CAM[6:]
    for pdu in (CAM, other, LATER):
        bench.channel.transmit(HEAD + pdu)
    assert bench.sent == []
    bench.channel.period()
    assert [pdu for pdu, _, _ in bench.sent] == [other, LATER]
    assert bench.channel.counts.not_sent == {"replaced": 1}


def test_what_waits_when_the_rate_is_taken_away_is_counted(bench):
    bench.set(transmit__rate_hz=10.0)
    bench.channel.transmit(HEAD + CAM)
    bench.set()
    assert bench.channel.counts.not_sent == {"settings": 1}
    bench.channel.period()
    assert bench.sent == []


def test_a_period_without_a_station_does_not_end_the_node(bench):
    bench.set(transmit__rate_hz=10.0)
    bench.channel.transmit(HEAD + CAM)
    bench.has_station = False
    bench.channel.period()
    assert bench.channel.counts.not_sent == {"no-station": 1}


def test_refusal_of_the_station_is_logged_with_its_reason(bench):
    bench.channel.confirmed({"outcome": "accepted"})
    bench.channel.confirmed({"outcome": "refused", "reason": "no-port", "meaning": "no BTP port", "interface": ""})
    bench.channel.confirmed({"outcome": "dropped", "reason": "expired", "meaning": "too old", "interface": "g5"})
    assert bench.channel.counts.outcomes == {"accepted": 1, "refused": 1, "dropped": 1}
    refused, dropped = bench.lines
    assert tells(refused, "cam/transmitted: ", "refused by the station: no-port (no BTP port)")
    assert dropped == "cam/transmitted: dropped by g5: expired (too old)"


def status(bench: Bench, since: Counts, strangers: list[str] | None = None) -> diagnosis.Status:
    return diagnosis.of_handler("cam", bench.channel.counts, since, strangers or [], (True, True))


def test_diagnostics_warn_of_what_went_wrong_since_they_were_last_told(bench):
    assert status(bench, Counts()).level == diagnosis.OK
    bench.channel.transmit(b"")
    found = status(bench, Counts())
    assert (found.level, found.values["not sent: foreign"]) == (diagnosis.WARN, "1")
    assert "octet 0" in found.message
    assert status(bench, bench.channel.counts).level == diagnosis.OK


def test_diagnostics_warn_of_nothing_that_was_wanted(bench):
    bench.set(transmit__active=False, receive__stations=[1])
    bench.channel.transmit(HEAD + CAM)
    bench.channel.receive(ARRIVAL)
    assert status(bench, Counts()).level == diagnosis.OK


def test_diagnostics_warn_of_strangers_for_as_long_as_they_are_there(bench):
    assert status(bench, Counts(), ["another type"])[:3] == (diagnosis.WARN, "cam", "another type")


def test_station_is_an_error_while_silent_and_a_warning_while_an_interface_is_down():
    def level(is_there: bool | None, state: str = "up") -> tuple[int, str]:
        told = {"interfaces": {"g5": {"state": state, "why": "unplugged"}}}
        found = diagnosis.of_station("tcp://x:1", is_there, told, 0, b"", {})
        return found.level, found.message

    found, message = level(None)
    assert found == diagnosis.ERROR
    assert tells(message, "no station ", "tcp://x:1")
    assert level(False)[0] == diagnosis.ERROR
    assert level(True) == (diagnosis.OK, "connected")
    assert level(True, "down") == (diagnosis.WARN, "g5 is down: unplugged")


def test_complaint_after_held_back_ones_gives_their_count():
    complaints = Complaints(1.0)
    said = [complaints.say("cam", "foreign", "bad", now) for now in (0.0, 0.5, 0.9, 1.0, 1.1)]
    first, *held_back, later, last = said
    assert (first, held_back, last) == ("cam: bad", [None, None], None)
    assert tells(str(later), "cam: bad ", "2 more")
    assert complaints.say("cam", "header", "other", 1.1) == "cam: other"


def test_counts_that_were_copied_do_not_count_on(bench):
    bench.channel.transmit(b"")
    copied = bench.channel.counts.now()
    bench.channel.transmit(b"")
    bench.channel.confirmed({"outcome": "sent"})
    assert (copied.taken, copied.not_sent, copied.outcomes) == (1, {"foreign": 1}, {})


def test_a_topic_of_lists_carries_one_message_in_each_both_ways():
    bench = Bench()
    bench.channel.frame = b"captain"
    bench.channel.receive(ARRIVAL)
    [said] = bench.channel.publisher.said
    assert said != HEAD + CAM
    assert lists.unwrap(said) == HEAD + CAM
    bench.channel.transmit(said)
    assert [pdu for pdu, _, _ in bench.sent] == [CAM]
    bench.channel.transmit(HEAD + CAM)
    assert bench.channel.counts.not_sent["foreign"] + bench.channel.counts.not_sent["list"] == 1
