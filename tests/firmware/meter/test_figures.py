"""Numbers made of fates: samples, gaps, age of information, rows, intervals, several ways at once, places."""

import itertools
import json
import math
import statistics

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.message import Position
from firmware.codec.decoding import Decoder
from firmware.codec.library import load
from firmware.codec.reading import Pdu
from firmware.lab.laboratory import Vector, vectors
from firmware.meter.age import Age, Gaps
from firmware.meter.delay import link, one_way
from firmware.meter.event import NO_CLOCK, PROBES, Clock, ReceivedEvent, Sent
from firmware.meter.fate import Fate
from firmware.meter.figures import OTHERS, Figures, Rows
from firmware.meter.meter import Ends, Meter
from firmware.meter.report.spots import Spots
from firmware.meter.result import figures as figures_of
from firmware.meter.sample import Sample
from firmware.meter.sender_position import position_of
from firmware.meter.window import Windows
from tests.firmware.meter.events import ONE_CLOCK, START_NS, received, sent, what
from tests.firmware.meter.test_matching import fates

S = 1_000_000_000


# -- samples


@given(values=st.lists(st.floats(-1e9, 1e9), max_size=300))
def test_a_sample_knows_mean_and_extremes_of_all_and_quantiles_of_what_is_kept(values: list[float]) -> None:
    sample = Sample(most=64)
    for value in values:
        sample.add(value)
    assert sample.count == len(values)
    assert len(sample.values()) <= 64
    if values:
        assert sample.mean == pytest.approx(statistics.fmean(values), abs=1e-3)
        assert (sample.least, sample.most) == (min(values), max(values))
        assert set(sample.values()) <= set(values)
    if 0 < len(values) <= 64:
        assert sample.quantiles(0.5, 1.0) == [statistics.median_low(values), max(values)]


def test_what_is_kept_of_a_long_sample_is_spread_evenly() -> None:
    sample = Sample(most=100)
    for value in range(1000):
        sample.add(value)
    kept = list(sample.values())
    assert {later - earlier for earlier, later in itertools.pairwise(kept)} == {kept[1] - kept[0]}
    assert kept[-1] >= 980


def test_nothing_has_no_mean() -> None:
    assert math.isnan(Sample().mean)
    assert math.isnan(Sample().quantiles(0.5)[0])


# -- delays


def test_a_delay_of_one_clock_is_as_uncertain_as_the_moment_of_leaving_and_its_reading() -> None:
    event = Sent("A", "air", what(1), START_NS, 300_000, 40_000, ONE_CLOCK, 0.0)
    heard = ReceivedEvent("B", "air", what(1), START_NS + 1_000_000, ONE_CLOCK, 0.0)
    assert link(event, heard) == (680_000, 30_000)
    assert one_way(event, heard) == (1_000_000, 10_000)


def test_a_delay_between_two_clocks_has_the_uncertainties_of_both() -> None:
    event = Sent("A", "air", what(1), START_NS, 0, 0, Clock("a", 5_000, 1_000), 0.0)
    heard = ReceivedEvent("B", "air", what(1), START_NS + 1_000_000, Clock("b", -2_000, 700), 0.0)
    assert one_way(event, heard) == (1_000_000 - 5_000 - 2_000, 11_700)


@pytest.mark.parametrize("clock", [NO_CLOCK, Clock("b"), Clock("b", 0, None)])
def test_a_clock_of_unknown_quality_gives_no_delay(clock: Clock) -> None:
    assert one_way(sent(1, 0.0), received(1, 0.1, clock=clock)) is None


# -- gaps and age


def test_gaps_are_between_receptions() -> None:
    gaps = Gaps(10)
    assert [gaps.add(at * S) for at in (10, 11, 14)] == [None, 1.0, 3.0]
    assert (gaps.gaps.count, gaps.gaps.most) == (2, 3.0)


def test_age_grows_until_something_fresher_comes() -> None:
    """Made each second and 0.1 s under way; the third is lost: 0.1 to 1.1 s, and once to 2.1 s."""
    age = Age(10)
    for made in (0, 1, 3, 4):
        age.add(made * S + S // 10, S // 10)
    assert list(age.peaks.values()) == [1.1, 2.1, 1.1]
    # The mean of a saw-tooth: (0.6 * 1 + 1.1 * 2 + 0.6 * 1) / 4
    assert age.mean_s() == pytest.approx(0.85)


def test_what_is_older_than_what_is_known_makes_nothing_fresher() -> None:
    age = Age(10)
    age.add(2 * S, S // 10)
    age.add(3 * S, 2 * S)  # under way for 2 s: overtaken
    age.add(4 * S, S // 10)
    assert list(age.peaks.values()) == [2.1]


# -- figures, rows, windows


def test_what_nothing_has_ended_counts_as_a_gap_and_makes_age() -> None:
    """Each 0.1 s for 10 s, and the link is dead for the last 6."""
    meter = Meter(grace_s=0.5)
    for name in "AB":
        meter.station(name, {"air": ""})
    events = [*(sent(n, n * 0.1) for n in range(100)), *(received(n, n * 0.1 + 0.01) for n in range(40))]
    metered(*events, meter=meter)
    (whole,) = (one.whole for one in meter.ways.values() if one.whole.sent)
    assert whole.open_s == pytest.approx(9.9 - 3.91)
    told = figures_of(whole)
    assert told["gap_s"]["most"] == pytest.approx(5.99)  # type: ignore[index]
    assert told["age_s"]["peak"]["most"] == pytest.approx(6.0)  # type: ignore[index]
    assert told["age_s"]["mean"] > 1.8  # type: ignore[index]


def test_figures_count_fates_and_measure_what_arrived() -> None:
    figures = Figures()
    for one in fates(
        *(sent(n, n * 0.1) for n in range(10)),
        *(received(n, n * 0.1 + 0.005) for n in range(10) if n != 4),
        received(7, 0.75),
    ):
        figures.add(one)
    assert (figures.sent, figures.lost, figures.loss, figures.counts[Fate.DUPLICATE]) == (10, 1, 0.1, 1)
    assert figures.one_way_us.quantiles(0.0, 1.0) == [5000.0, 5000.0]
    assert figures.gaps.gaps.most == 0.2
    assert figures.rssi_dbm.mean == -70


def test_a_late_message_is_no_lost_one_in_the_end() -> None:
    figures = Figures()
    for one in fates(sent(1, 0.0), sent(2, 5.0), received(1, 5.0), received(2, 5.1)):
        figures.add(one)
    assert (figures.sent, figures.lost, figures.loss, figures.counts[Fate.LATE]) == (2, 0, 0.0, 1)
    assert figures.one_way_us.count == 2


def test_rows_are_by_way_type_and_station_and_beyond_some_there_is_one_for_all_others() -> None:
    rows = Rows(most=3)
    for turn in range(2):
        for n in range(5):
            for one in fates(sent(n, turn * 1.0)._replace(what=what(n, station_id=n))):
                rows.add(one)
    told = {(key.type, key.station_id): figures.sent for key, figures in rows}
    assert told == {("cam", 0): 2, ("cam", 1): 2, ("cam", 2): 2, (OTHERS, None): 4}


def test_what_came_late_is_taken_back_from_the_interval_in_which_it_was_sent() -> None:
    windows = Windows(1.0)
    for one in fates(sent(1, 0.5), sent(2, 5.0), received(1, 5.0), received(2, 5.1)):
        windows.add(one)
    assert [(begun, one.sent, one.arrived, one.lost) for begun, one in windows] == [(0.0, 1, 1, 0), (5.0, 1, 1, 0)]


def test_an_interval_has_what_was_sent_in_it() -> None:
    windows = Windows(1.0)
    for one in fates(
        *(sent(n, n * 0.25) for n in range(8)), *(received(n, n * 0.25 + 0.01) for n in range(8) if n not in (1, 6))
    ):
        windows.add(one)
    told = [(begun, one.sent, one.arrived, one.lost) for begun, one in windows]
    assert told == [(0.0, 4, 3, 1), (1.0, 4, 3, 1)]
    assert [one.as_json()["delay_us"] for _, one in windows] == [10_000.0, 10_000.0]
    assert [one.gap_longest_s for _, one in windows] == [0.5, 0.5]


def test_only_so_many_intervals_are_kept() -> None:
    windows = Windows(1.0, most=3)
    for n in range(10):
        for one in fates(sent(n, float(n))):
            windows.add(one)
    assert ([begun for begun, _ in windows], windows.forgotten) == ([7.0, 8.0, 9.0], 7)


# -- the meter: several ways


BOTH = {"g5": "its-g5", "v2n": "5g"}


def metered(*events: Sent | ReceivedEvent, meter: Meter) -> Meter:
    for event in sorted(events, key=lambda event: event.at_s):
        if isinstance(event, Sent):
            meter.sent(event)
        else:
            meter.received(event)
        meter.settle(event.at_s)
    meter.finish()
    return meter


def test_of_two_ways_it_is_known_which_was_first_and_what_both_gain() -> None:
    meter = Meter(grace_s=0.5)
    meter.station("A", BOTH)
    meter.station("B", BOTH)
    lost = {"g5": {1, 2}, "v2n": {2, 3, 4}}
    delays = {"g5": 0.004, "v2n": 0.030}
    metered(
        *(sent(n, n * 0.1, by=by) for n in range(10) for by in BOTH),
        *(received(n, n * 0.1 + delays[by], by=by) for n in range(10) for by in BOTH if n not in lost[by]),
        meter=meter,
    )
    ((between, both),) = meter.paths.both.items()
    assert tuple(between) == ("A", "B")
    assert (both.sent, both.arrived, both.delivery) == (10, 9, 0.9)
    figures = {way.out: one for way, one in both.ways.items()}
    assert (figures["g5"].delivery, figures["v2n"].delivery) == (0.8, 0.7)
    assert both.gain == pytest.approx(0.1)
    assert (figures["g5"].first, figures["g5"].alone) == (6, 2)
    assert (figures["v2n"].first, figures["v2n"].alone) == (0, 1)
    assert figures["g5"].lead_us.mean == pytest.approx(26_000, abs=1)


def test_what_comes_late_by_one_way_corrects_who_was_alone() -> None:
    """v2n takes 2.5 s and more than the grace; g5 loses every third."""
    meter = Meter(grace_s=0.5)
    meter.station("A", BOTH)
    meter.station("B", BOTH)
    metered(
        *(sent(n, n * 0.1, by=by) for n in range(30) for by in BOTH),
        *(received(n, n * 0.1 + 0.004, by="g5") for n in range(30) if n % 3),
        *(received(n, n * 0.1 + 2.5, by="v2n") for n in range(30)),
        meter=meter,
    )
    ((_, both),) = meter.paths.both.items()
    figures = {way.out: one for way, one in both.ways.items()}
    assert (both.sent, both.arrived, figures["g5"].arrived, figures["v2n"].arrived) == (30, 30, 20, 30)
    assert [(one.first, one.alone) for one in figures.values()] == [(20, 0), (0, 10)]
    whole = next(one.whole for way, one in meter.ways.items() if (way.sender, way.out) == ("A", "v2n"))
    assert (whole.counts[Fate.LATE], whole.lost, whole.arrived) == (30, 0, 30)


def test_a_way_that_a_message_left_by_when_it_had_been_judged_is_not_beside_the_others() -> None:
    """wlan loses it; v2n sends it 5 s later, and takes 3 s."""
    meter = Meter(grace_s=0.5)
    for station in "AB":
        meter.station(station, {**BOTH, "wlan": "wlan"})
    metered(
        *(sent("a", 0.0, by=by) for by in ("g5", "wlan")),
        received("a", 0.004, by="g5"),
        sent("a", 5.0, by="v2n"),
        received("a", 8.0, by="v2n"),
        *(sent(n, n * 0.5, by="g5") for n in range(30)),
        meter=meter,
    )
    ((_, both),) = meter.paths.both.items()
    assert {way.out: (one.sent, one.arrived) for way, one in both.ways.items()} == {"g5": (1, 1), "wlan": (1, 0)}


def test_the_first_message_counts_though_its_reception_is_heard_of_first() -> None:
    meter = Meter(grace_s=0.5)
    meter.station("A", {"air": ""})
    meter.station("B", {"air": ""})
    metered(received(1, 0.004), sent(1, 0.0, heard_s=0.2), meter=meter)
    assert (meter.sent_count, meter.arrived, meter.lost) == (1, 1, 0)


def test_interfaces_of_one_technology_hear_each_other_whatever_they_are_called() -> None:
    meter = Meter()
    meter.station("A", {"g5": "its-g5", "net": "5g"})
    meter.station("B", {"radio": "its-g5", "net": "5g"})
    assert {(way.out, way.into) for way in meter.ways if way.sender == "A"} == {("g5", "radio"), ("net", "net")}


def test_interfaces_that_are_named_hear_each_other_both_ways() -> None:
    meter = Meter(named=[Ends(("A", "g5"), ("B", "net"))])
    meter.station("A", {"g5": "its-g5"})
    meter.station("B", {"net": "udp"})
    assert {str(way) for way in meter.ways} == {"A > B g5 > net", "B > A net > g5"}


def test_interfaces_that_were_named_and_do_not_exist_are_told() -> None:
    meter = Meter(named=[Ends(("Z", "g5"), ("B", "none")), Ends(("A", "g5"), ("B", "net"))])
    meter.station("A", {"g5": "its-g5"})
    meter.station("B", {"net": "udp"})
    assert meter.strangers() == ["B:none", "Z:g5"]


def test_a_round_trip_is_that_of_probes_alone() -> None:
    meter = Meter(grace_s=0.5, round_trips_of="A")
    meter.station("A", {"air": ""})
    meter.station("B", {"air": ""})
    probe = what(1, station_id=PROBES)
    back = received(1, 0.02)._replace(station="A", what=probe)
    own = sent(1, 0.0)._replace(what=probe, is_probe=True)
    another = sent(3, 0.2)._replace(what=what(3, station_id=PROBES))  # of another meter
    metered(own, back, another, sent(2, 0.1)._replace(what=what(2, station_id=4)), meter=meter)
    (measured,) = (one for way, one in meter.ways.items() if way.is_round_trip)
    assert (measured.whole.sent, measured.whole.lost) == (1, 0)
    assert measured.whole.one_way_us.mean == 20_000


def test_what_the_meter_missed_is_unseen_and_no_loss() -> None:
    meter = Meter(grace_s=0.5)
    meter.station("A", {"air": ""})
    meter.station("B", {"air": ""})
    meter.unheard("B", 1, 0.0, 0.2)
    metered(sent(1, 0.1), sent(2, 0.1), meter=meter)
    (measured,) = (one for way, one in meter.ways.items() if way.sender == "A")
    assert (measured.whole.lost, measured.whole.counts[Fate.UNSEEN], measured.whole.loss) == (1, 1, None)


def test_the_share_that_is_lost_is_of_what_was_sent_while_all_was_heard() -> None:
    """Every tenth is lost. Of the middle third the meter hears half: what it has heard of that is no fair share."""
    meter = Meter(grace_s=0.5)
    for name in "AB":
        meter.station(name, {"air": ""})
    meter.unheard("B", 50, 10.5, 19.5)
    arrived = [n for n in range(300) if n % 10 and not (100 <= n < 200 and n % 2)]
    metered(*(sent(n, n * 0.1) for n in range(300)), *(received(n, n * 0.1 + 0.01) for n in arrived), meter=meter)
    (whole,) = (one.whole for one in meter.ways.values() if one.whole.sent)
    assert whole.counts[Fate.UNSEEN] == 50
    assert whole.loss == pytest.approx(0.1, abs=0.005)


# -- places


@pytest.mark.parametrize(
    "vector", [vector for vector in vectors() if vector.type == "cam"], ids=lambda vector: vector.name
)
def test_a_cam_says_where_it_was_made_as_the_codec_reads_it(vector: Vector) -> None:
    found = Decoder(load()).identify(Pdu(vector.pdu, "")).message
    told = json.loads(found.to_json(vector.pdu))
    place = told["cam"]["camParameters"]["basicContainer"]["referencePosition"]
    is_known = place["latitude"] != 900_000_001
    assert position_of(vector.pdu) == ((place["latitude"], place["longitude"]) if is_known else None)


def test_a_place_is_that_of_the_interface_or_nothing() -> None:
    assert position_of(b"", Position(1, 2)) == (1, 2)
    assert position_of(b"\2\1") is None
    assert position_of(bytes([2, 1]) + bytes(40)) is None


def test_a_lost_message_is_placed_between_its_neighbours() -> None:
    spots = Spots()
    for n, place in ((0, Position(480_000_000, 110_000_000)), (2, Position(480_000_200, 110_000_400))):
        spots.note_message(str(n), place)
    for one in fates(*(sent(n, n * 1.0) for n in range(4)), received(0, 0.1), received(2, 2.1)):
        spots.add(one)
    told = {spot.at_s: spot for spot in spots}
    assert sorted(told) == [0.0, 1.0, 2.0]  # of the last one nobody knows where it was sent
    assert (told[1.0].is_lost, told[1.0].is_guessed) == (True, True)
    assert told[1.0].sender == pytest.approx((48.00001, 11.00002))


def test_a_station_that_says_where_it_is_places_what_it_sent_and_what_it_received() -> None:
    spots = Spots()
    for at_s in (0.0, 2.0):
        spots.note_station("A", at_s, Position(480_000_000 + round(at_s * 100), 110_000_000))
        spots.note_station("B", at_s, Position(490_000_000, 120_000_000))
    for one in fates(sent(1, 1.0), received(1, 1.1), sent(2, 1.5)):
        spots.add(one)
    assert [(spot.sender, spot.receiver, spot.is_lost) for spot in spots] == [
        ((48.00001, 11.0), (49.0, 12.0), False),
        ((48.000015, 11.0), (49.0, 12.0), True),
    ]
