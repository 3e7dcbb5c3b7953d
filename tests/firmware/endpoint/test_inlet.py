"""Input of users: envelopes, frames, sizes; a good message always passes."""

import json
from collections.abc import Iterator
from contextlib import closing

import pytest
import zmq
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.message import MessageType
from drivers.reason import Reason
from firmware.endpoint.inlet import BATCH, SUB_HWM, Inlet
from firmware.routing.drops import Drops
from firmware.routing.options import Parsed
from firmware.routing.router import Routing
from firmware.topics import Topics
from tests.firmware.doubles import CAM_PDU, pdu_of
from tests.virtual import VirtualLoop

GOOD = [b"v2x.cam.", CAM_PDU]


class NotingRouter:
    def __init__(self) -> None:
        self.requests: list[tuple[str, bytes]] = []
        self.asked: list[Parsed] = []
        self.refusals: list[Reason] = []
        self.labels: list[str] = []
        self.details: list[str] = []

    def request(self, kind: MessageType, pdu: bytes, where: str, asked: Parsed) -> None:
        self.requests.append((kind.name, pdu))
        self.asked.append(asked)

    def refuse_message(
        self, reason: Reason, sample: bytes, where: str, kind: object = None, label: str = "", detail: str = ""
    ) -> None:
        assert where in ("pull", "from_users")
        self.refusals.append(reason)
        self.labels.append(label)
        self.details.append(detail)


class NotingJson:
    def __init__(self) -> None:
        self.requests: list[tuple[str | None, bytes, str]] = []

    def request(self, kind: MessageType | None, body: bytes, where: str, asked: Parsed) -> None:
        assert where == "pull"
        self.requests.append((kind.name if kind else None, body, asked.options.form))


class Bench:
    def __init__(
        self, loop: VirtualLoop, takes_options: bool = True, is_strict: bool = False, profile: str = "standard"
    ) -> None:
        self.loop = loop
        self.context = zmq.Context()
        self.router = NotingRouter()
        kind, name = (zmq.PULL, "pull") if takes_options else (zmq.SUB, "from_users")
        routing = Routing(loop, Topics(profile), Drops(), self.router)
        self.json = NotingJson()
        json = self.json if takes_options else None
        self.inlet = Inlet(routing, self.context, kind, "inproc://inlet", name, json, is_strict)
        self.user = self.context.socket(zmq.PUSH if takes_options else zmq.PUB)
        self.user.set(zmq.LINGER, 0)
        self.user.connect("inproc://inlet")
        self.loop.turn()

    def send(self, *frames: bytes) -> None:
        self.user.send_multipart(frames)

    def turn(self) -> None:
        self.loop.run_for(0.1)

    def close(self) -> None:
        self.user.close(0)
        if not self.inlet._socket.closed:
            self.inlet.close()
        self.context.term()


@pytest.fixture(params=["pull", "sub"])
def bench(request: pytest.FixtureRequest) -> Iterator[Bench]:
    with closing(VirtualLoop()) as loop, closing(Bench(loop, request.param == "pull")) as bench:
        yield bench


@pytest.fixture
def pull() -> Iterator[Bench]:
    with closing(VirtualLoop()) as loop, closing(Bench(loop)) as bench:
        yield bench


@pytest.mark.parametrize(
    ("frames", "reason"),
    [
        ([b"v2x.cam", CAM_PDU], Reason.BAD_ENVELOPE),
        ([b"v2x.CAM.", CAM_PDU], Reason.BAD_ENVELOPE),
        ([b"v2x.cam.foo.", CAM_PDU], Reason.BAD_ENVELOPE),
        ([b"V2X.", CAM_PDU], Reason.BAD_ENVELOPE),
        ([b"v2x", CAM_PDU], Reason.BAD_ENVELOPE),
        ([b"v2x..", CAM_PDU], Reason.BAD_ENVELOPE),
        ([b"raw.", CAM_PDU], Reason.BAD_ENVELOPE),
        ([b"", CAM_PDU], Reason.BAD_ENVELOPE),
        ([b"\0v2x.", CAM_PDU], Reason.BAD_ENVELOPE),
        ([b"v2x."], Reason.ONE_FRAME),
        ([b"v2x.cam."], Reason.ONE_FRAME),
        ([b""], Reason.ONE_FRAME),
        ([b"v2x.", b""], Reason.EMPTY_PDU),
        ([b"v2x.", b"\x02"], Reason.SHORT_PDU),
        ([b"v2x.", CAM_PDU[:5]], Reason.SHORT_PDU),
        ([b"v2x.cam.", b""], Reason.EMPTY_PDU),
        ([b"v2x.", bytes(1501)], Reason.LONG_PDU),
        ([b"v2x.cam.", bytes(1501)], Reason.LONG_PDU),
        ([b"v2x.cam.", bytes(65000)], Reason.LONG_PDU),
    ],
)
def test_this_is_refused_with_its_reason_and_the_next_message_passes(
    bench: Bench, frames: list[bytes], reason: Reason
) -> None:
    bench.send(*frames)
    bench.send(*GOOD)
    bench.turn()
    assert bench.router.refusals == [reason]
    assert bench.router.requests == [("cam", CAM_PDU)]


@pytest.mark.parametrize(
    ("envelope", "pdu", "name"),
    [
        (b"v2x.", CAM_PDU, "cam"),
        (b"v2x.", CAM_PDU[:6], "cam"),
        (b"v2x.", pdu_of(222), ""),
        (b"v2x.", pdu_of(2, body=bytes(1494)), "cam"),
        (b"v2x.denm.", CAM_PDU, "denm"),
        (b"v2x.cam.", b"\x07", "cam"),
        (b"v2x.cam.", bytes(1500), "cam"),
    ],
)
def test_this_is_taken_as_it_is(bench: Bench, envelope: bytes, pdu: bytes, name: str) -> None:
    bench.send(envelope, pdu)
    bench.turn()
    assert (bench.router.requests, bench.router.refusals) == ([(name, pdu)], [])


def test_drain_takes_what_has_arrived_and_nothing_once_closed(bench: Bench) -> None:
    bench.send(*GOOD)
    assert bench.inlet.drain(1)
    assert bench.router.requests == [("cam", CAM_PDU)]
    bench.send(*GOOD)
    bench.inlet.close()
    assert bench.inlet.drain(1)
    assert bench.router.requests == [("cam", CAM_PDU)]


@pytest.mark.parametrize("more", [[b""], [b"x"], [b"{}", b"{}"], [b"x"] * 50])
def test_without_options_the_first_two_frames_are_used_and_the_rest_is_not(more: list[bytes]) -> None:
    with closing(VirtualLoop()) as loop, closing(Bench(loop, takes_options=False)) as bench:
        bench.send(*GOOD, *more)
        bench.send(*GOOD)
        bench.turn()
        assert (len(bench.router.requests), bench.router.refusals) == (2, [])


def test_a_third_frame_is_options_where_they_are_taken(pull: Bench) -> None:
    pull.send(*GOOD, b'{"label": "mine", "priority": 0}')
    pull.send(*GOOD)
    pull.turn()
    first, second = pull.router.asked
    assert (first.options.label, first.options.priority) == ("mine", 0)
    assert second.options.label == ""


@pytest.mark.parametrize("third", [b"", b"x", b"[]", b'{"colour": 1}', b'{"label": null}', b"[" * 5000])
def test_options_that_cannot_be_read_refuse_their_message_alone(pull: Bench, third: bytes) -> None:
    pull.send(*GOOD, third)
    pull.send(*GOOD)
    pull.turn()
    assert pull.router.refusals == [Reason.BAD_OPTIONS]
    assert pull.router.details[0].startswith("options:")
    assert len(pull.router.requests) == 1


def test_the_users_label_is_on_the_refusal(pull: Bench) -> None:
    pull.send(b"nonsense", CAM_PDU, b'{"label": "mine"}')
    pull.turn()
    assert (pull.router.refusals, pull.router.labels) == ([Reason.BAD_ENVELOPE], ["mine"])


def test_frames_beyond_the_third_are_read_and_ignored(pull: Bench) -> None:
    pull.send(*GOOD, b'{"label": "mine"}', b"x", b"", b"y")
    pull.send(*GOOD)
    pull.turn()
    assert [asked.options.label for asked in pull.router.asked] == ["mine", ""]


@pytest.mark.parametrize(
    ("envelope", "pdu", "refusals"),
    [
        (b"v2x.cam.", CAM_PDU, []),
        (b"v2x.vam.", pdu_of(16), []),
        (b"v2x.vam.", pdu_of(102), []),
        (b"v2x.", pdu_of(222), []),
        (b"v2x.denm.", CAM_PDU, [Reason.HEADER_MISMATCH]),
        (b"v2x.cam.", pdu_of(222), [Reason.HEADER_MISMATCH]),
        (b"v2x.cam.", CAM_PDU[:5], [Reason.SHORT_PDU]),
        (b"v2x.cam.", b"\x02", [Reason.SHORT_PDU]),
    ],
)
def test_strict_checking_compares_the_envelope_with_the_header(
    envelope: bytes, pdu: bytes, refusals: list[Reason]
) -> None:
    with closing(VirtualLoop()) as loop, closing(Bench(loop, is_strict=True)) as bench:
        bench.send(envelope, pdu)
        bench.turn()
        assert bench.router.refusals == refusals
        assert len(bench.router.requests) == 1 - len(refusals)


def test_a_burst_is_taken_a_batch_a_turn_so_that_others_have_theirs(pull: Bench) -> None:
    for _ in range(3 * BATCH):
        pull.send(*GOOD)
    pull.loop.turn()
    assert 0 < len(pull.router.requests) <= 2 * BATCH
    pull.turn()
    assert len(pull.router.requests) == 3 * BATCH


def test_edges_while_a_burst_is_taken_make_no_larger_batches(pull: Bench) -> None:
    for _ in range(20 * BATCH):
        pull.send(*GOOD)
    for _ in range(5):
        pull.inlet.ready()
    assert len(pull.router.requests) == BATCH
    pull.loop.turn()
    assert len(pull.router.requests) == 2 * BATCH


def test_a_burst_as_long_as_the_queue_is_taken_whole() -> None:
    with closing(VirtualLoop()) as loop, closing(Bench(loop, takes_options=False)) as bench:
        for number in range(SUB_HWM):
            bench.send(b"v2x.cam.", number.to_bytes(4, "big"))
        bench.turn()
        assert [int.from_bytes(pdu, "big") for _, pdu in bench.router.requests] == list(range(SUB_HWM))


def test_a_stop_takes_what_has_arrived(pull: Bench) -> None:
    for _ in range(500):
        pull.send(*GOOD)
    pull.inlet.finish(pull.loop.clock() + 1.0)
    assert len(pull.router.requests) == 500
    pull.turn()


def test_a_turn_that_was_asked_for_before_the_stop_does_nothing_after_it(pull: Bench) -> None:
    for _ in range(3 * BATCH):
        pull.send(*GOOD)
    pull.loop.turn()
    pull.inlet.finish(pull.loop.clock() + 1.0)
    pull.turn()
    assert len(pull.router.requests) == 3 * BATCH


FRAMES = st.lists(
    st.sampled_from([b"v2x.", b"v2x.cam.", b"", CAM_PDU, b"{}", bytes(1501)]) | st.binary(max_size=20),
    min_size=1,
    max_size=5,
)


@given(st.lists(FRAMES, max_size=10))
@settings(max_examples=50)
def test_any_frames_are_each_taken_or_refused_once(messages: list[list[bytes]]) -> None:
    with closing(VirtualLoop()) as loop, closing(Bench(loop)) as bench:
        for frames in messages:
            bench.send(*frames)
        bench.send(*GOOD)
        bench.turn()
        assert len(bench.router.requests) + len(bench.router.refusals) == len(messages) + 1
        assert bench.router.requests[-1] == ("cam", CAM_PDU)


@pytest.mark.parametrize("form", ["json", "plain"])
@pytest.mark.parametrize(("envelope", "name"), [(b"v2x.", None), (b"v2x.cam.", "cam")])
def test_message_whose_options_say_json_goes_to_the_side_for_json(envelope: bytes, name: str | None, form: str) -> None:
    with closing(VirtualLoop()) as loop, closing(Bench(loop)) as bench:
        bench.send(envelope, b"{}", json.dumps({"form": form}).encode())
        bench.turn()
        assert bench.json.requests == [(name, b"{}", form)]
        assert bench.router.requests == []


def test_json_with_an_unknown_envelope_is_refused() -> None:
    with closing(VirtualLoop()) as loop, closing(Bench(loop)) as bench:
        bench.send(b"v2x.cams.", b"{}", b'{"form": "json"}')
        bench.turn()
        assert (bench.json.requests, bench.router.refusals) == ([], [Reason.BAD_ENVELOPE])
