"""Queues: order by priority, lifetime, policy."""

from functools import partial
from typing import Any

import pytest

from tests.system.air import single_hop
from tests.system.conftest import Bench, Launcher
from tests.system.user import Reports, mark

CAM = bytes.fromhex("020200000539")
DENM = bytes.fromhex("020100000539")


def test_a_denm_overtakes_cams_that_wait(launch: Launcher) -> None:
    bench = launch("pdu", options={"g5": {"rate_per_s": 25}})
    for number in range(12):
        bench.user.push_pdu(b"v2x.cam.", CAM + bytes((number,)), lifetime_s=10)
    bench.user.push_pdu(b"v2x.denm.", DENM)
    heard = [bench.air.hear().pdu for _ in range(13)]
    assert heard.index(DENM) <= 4
    assert [pdu for pdu in heard if pdu != DENM] == [CAM + bytes((number,)) for number in range(12)]


def test_a_users_priority_overtakes_as_well(launch: Launcher) -> None:
    bench = launch("pdu", options={"g5": {"rate_per_s": 25}})
    for number in range(10):
        bench.user.push_pdu(b"v2x.cam.", CAM + bytes((number,)), lifetime_s=10)
    bench.user.push_pdu(b"v2x.cam.", urgent := mark(), priority=0)
    assert urgent in [bench.air.hear().pdu for _ in range(5)]


def test_what_is_older_than_its_lifetime_is_not_sent(launch: Launcher) -> None:
    bench = launch("pdu", options={"g5": {"rate_per_s": 4}})
    reports = bench.make_reports()
    for number in range(4):
        bench.user.push_pdu(b"v2x.cam.", CAM + bytes((number,)), lifetime_s=0.01, label=f"old{number}")
    bench.user.push_pdu(b"v2x.cam.", last := mark(), lifetime_s=10, label="last")
    dropped = [confirm for confirm in _until_sent(reports, "last") if confirm["outcome"] == "dropped"]
    assert {confirm["reason"] for confirm in dropped} == {"expired"}
    assert len(dropped) >= 2
    assert last in [bench.air.hear().pdu for _ in range(5 - len(dropped))]


def _until_sent(reports: Reports, label: str) -> list[dict[str, Any]]:
    confirms = [reports.next()[1]]
    while (confirms[-1]["label"], confirms[-1]["outcome"]) != (label, "sent"):
        confirms.append(reports.next()[1])
    return confirms


def test_a_full_queue_drops_the_oldest_of_the_lowest_priority(launch: Launcher) -> None:
    bench = launch("pdu", options={"g5": {"rate_per_s": 20, "queue": 4}})
    reports = bench.make_reports()
    bench.user.push_pdu(b"v2x.denm.", DENM, lifetime_s=10)
    for number in range(20):
        bench.user.push_pdu(b"v2x.cam.", CAM + bytes((number,)), lifetime_s=10, label=str(number))
    confirms = _until_sent(reports, "19")
    dropped = [int(confirm["label"]) for confirm in confirms if confirm["outcome"] == "dropped"]
    sent = [int(confirm["label"]) for confirm in confirms if confirm["outcome"] == "sent" and confirm["label"]]
    assert {confirm["reason"] for confirm in confirms if confirm["outcome"] == "dropped"} == {"queue-full"}
    assert sorted(dropped + sent) == list(range(20))
    assert dropped == sorted(dropped)
    assert sent[-3:] == [17, 18, 19]  # the DENM may have the fourth place
    assert bench.station.status()["interfaces"]["g5"]["sent"]["denm"] == 1


def test_the_same_pdu_by_two_interfaces_reaches_users_once(launch: Launcher) -> None:
    bench = launch(interfaces={"g5": "pdu", "lte": "pdu"})
    bench.air.send(sent := mark())
    assert bench.user.receive().pdu == sent
    bench.airs["lte"].send(sent)
    status = bench.station.until(lambda status: status["duplicates"]["suppressed"] == 1)
    assert status["duplicates"]["first"]["g5"] == 1
    assert status["duplicates"]["window_s"] == 2.0
    assert {(row["where"], row["reason"]) for row in status["drops"]} == {("lte", "duplicate")}
    bench.user.hears_nothing_before_a_mark(bench.air)


def test_the_kth_copy_of_one_interface_is_paired_with_the_kth_of_another(launch: Launcher) -> None:
    bench = launch(interfaces={"g5": "pdu", "lte": "pdu"}, reception={"duplicate_window_s": 60})
    sent = mark()
    for _ in range(3):
        bench.air.send(sent)
        assert bench.user.receive().pdu == sent
    for copies in range(1, 4):
        bench.airs["lte"].send(sent)
        bench.station.until(partial(_has_suppressed, copies))
    bench.airs["lte"].send(sent)
    assert bench.user.receive().pdu == sent


def _has_suppressed(count: int, status: dict[str, Any]) -> bool:
    return bool(status["duplicates"]["suppressed"] == count)


@pytest.mark.parametrize(
    "tables", [{"reception": {"duplicate_window_s": 0}}, {"station": {"profile": "legacy"}}], ids=["off", "legacy"]
)
def test_without_suppression_every_copy_is_delivered(launch: Launcher, tables: Any) -> None:
    bench = launch(interfaces={"g5": "pdu", "lte": "pdu"}, **tables)
    sent = mark()
    bench.air.send(sent)
    bench.airs["lte"].send(sent)
    assert [bench.user.receive().pdu, bench.user.receive().pdu] == [sent, sent]


FALL_BACK = """
[[policy]]
name = "ordinary"
match.type = ["cam"]
match.no_neighbours = { interface = "g5", within_s = 60 }
interfaces = ["lte"]

[[policy]]
name = "direct"
interfaces = ["g5"]
"""


def test_without_a_neighbour_on_one_interface_another_is_used(launch: Launcher) -> None:
    bench = launch(interfaces={"lte": "pdu", "g5": "ethernet"}, more=FALL_BACK)
    lte, g5 = bench.airs["lte"], bench.airs["g5"]
    bench.user.send(b"v2x.", first := mark())
    assert lte.hear().pdu == first
    g5.throw(single_hop(heard := mark()))
    while bench.user.receive().pdu != heard:
        pass
    bench.user.send(b"v2x.", second := mark())
    assert g5.hear().pdu == second
    assert {row["name"]: row["matched"] for row in bench.station.status()["policy"]}["direct"] == 1


def test_a_fall_back_is_used_while_the_named_interface_is_down(launch: Launcher) -> None:
    rows = '[[policy]]\ninterfaces = ["gone"]\nfallback = ["lte"]\n'
    gone = '[interfaces.gone]\ndriver = "ethernet"\ndevice = "nosuchdevice0"\n'
    bench = launch(interfaces={"lte": "pdu"}, more=rows + gone)
    bench.user.send(b"v2x.", sent := mark())
    assert bench.air.hear().pdu == sent


POLICIES = {
    "by type": 'match.type = ["denm"]',
    "by station": "match.station = [1337]",
    "by size": "match.size = { min = 20, max = 30 }",
    "by port": "match.btp_port = [2002]",
    "by octets under a mask": 'match.payload = [{ offset = 6, value = "f0", mask = "f0" }]',
}


@pytest.mark.parametrize("match", POLICIES.values(), ids=POLICIES.keys())
def test_a_row_applies_to_what_it_matches_and_to_nothing_else(launch: Launcher, match: str) -> None:
    more = f'[[policy]]\nname = "held"\n{match}\ninterfaces = []\n'
    bench = launch("pdu", more=more)
    bench.user.send(b"v2x.", bytes.fromhex("020100000539") + b"\xf7" + bytes(15))
    bench.user.send(b"v2x.", passes := bytes.fromhex("02020000053a") + b"\x07" + bytes(50))
    assert bench.air.hear().pdu == passes
    assert bench.station.drops() == {("from_users", "policy"): 1}


def test_a_rows_rate_limits_what_it_lets_through(launch: Launcher) -> None:
    more = '[[policy]]\nname = "slow"\nmatch.type = ["cam"]\nmatch.station = [1337]\nrate_per_s = 2\n'
    bench = launch("pdu", more=more)
    for _ in range(50):
        bench.user.send(b"v2x.", CAM)
    bench.user.send(b"v2x.", last := mark())
    passed = 0
    while bench.air.hear().pdu != last:
        passed += 1
    assert 2 <= passed < 50
    assert bench.station.drops()["from_users", "rate-limit"] == 50 - passed


def test_a_rows_priority_and_lifetime_replace_the_types(launch: Launcher) -> None:
    more = '[[policy]]\nname = "urgent"\nmatch.station = [7]\npriority = 0\nlifetime_s = 10\n'
    bench = launch("pdu", options={"g5": {"rate_per_s": 25}}, more=more)
    for number in range(10):
        bench.user.push_pdu(b"v2x.cam.", CAM + bytes((number,)), lifetime_s=10)
    bench.user.push_pdu(b"v2x.", urgent := bytes.fromhex("020200000007"))
    assert urgent in [bench.air.hear().pdu for _ in range(5)]


def test_a_flood_of_cams_on_one_interface_does_not_starve_the_other(launch: Launcher) -> None:
    bench = launch(interfaces={"g5": "pdu", "lte": "pdu"}, reception={"duplicate_window_s": 0})
    _flood_and_one_more(bench)


def _flood_and_one_more(bench: Bench) -> None:
    for number in range(3000):
        bench.air.throw(CAM + number.to_bytes(2, "big"))
        if number == 1500:
            bench.airs["lte"].throw(alone := mark())
    place = 0
    while bench.user.receive().pdu != alone:
        place += 1
    # The queue of the flood is read in batches, so the message waits for a few batches and not for the whole flood.
    assert place < 3000
