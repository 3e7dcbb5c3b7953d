"""Requests of a client: frames to the station, confirms, restarts."""

import json
import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from captain_client.errors import RefusedError, UnconfirmedError
from captain_client.requests import Confirmed, Request, Requests, check_type, outgoing

PDU = bytes.fromhex("0202000000070102")
INVALID = [{"path": "cam.x", "problem": "missing: 0 to 255", "value": None}]


def opened(requests: Requests, **options: Any) -> Request:
    return requests.open("cam", outgoing("cam", PDU, "", "", options, {}))[0]


def feed(requests: Requests, request: Request, outcome: str, **more: Any) -> bool:
    """Give the confirm of a request to the requests, as the station publishes it. Return whether it is over."""
    told = {"label": request.label, "type": "cam", "digest": "8bf6d42855cc559f", "outcome": outcome, **more}
    requests.report([b"confirm.cam.", json.dumps(told).encode()])
    return request.is_over


def status(requests: Requests, run: str) -> None:
    requests.report([b"status.", json.dumps({"run": run}).encode()])


# -- frames


@pytest.mark.parametrize(
    ("arguments", "body", "options"),
    [
        ((PDU, "", "", None, {}), PDU, {}),
        ((bytearray(PDU), "", "", {"lifetime_s": 2.0}, {}), PDU, {"lifetime_s": 2.0}),
        ((None, "", "", None, {"speed": 13.9}), {"fields": {"speed": 13.9}}, {"form": "plain"}),
        ((None, "", "cam-1.4.1", None, {}), {"edition": "cam-1.4.1", "fields": {}}, {"form": "plain"}),
        (({"cam": {}}, "", "", None, {}), {"message": {"cam": {}}}, {"form": "plain"}),
        (({"cam": {}}, "json", "cam", None, {}), {"edition": "cam", "message": {"cam": {}}}, {"form": "json"}),
    ],
)
def test_request_becomes_envelope_body_and_options_with_a_label(arguments: Any, body: Any, options: Any):
    request, (envelope, sent, told) = Requests().open("cam", outgoing("cam", *arguments))
    assert envelope == b"v2x.cam."
    assert (sent if isinstance(body, bytes) else json.loads(sent)) == body
    assert json.loads(told) == {**options, "label": request.label}


def test_request_with_an_edition_as_type_names_the_argument_for_editions():
    with pytest.raises(ValueError, match=r"""^'cam-1.4.1': .*; write send\("cam", edition="cam-1.4.1"\)$"""):
        outgoing("cam-1.4.1", None, "", "", None, {"speed": 1.0})


def test_type_that_is_an_edition_names_the_type():
    with pytest.raises(ValueError, match=r"""^'cam-1.4.1': .*; write "cam", which has all editions$"""):
        check_type("cam-1.4.1")


def test_request_without_a_type_leaves_the_type_to_the_station():
    assert outgoing("", PDU, "", "", None, {}).envelope == b"v2x."


@pytest.mark.parametrize(
    ("kind", "value", "form", "edition", "fields"),
    [
        ("CAM", PDU, "", "", {}),
        ("cam.", PDU, "", "", {}),
        ("cam", PDU, "plain", "", {}),
        ("cam", PDU, "", "cam-1.4.1", {}),
        ("cam", PDU, "", "", {"speed": 1}),
        ("cam", {"cam": {}}, "", "", {"speed": 1}),
        ("cam", {"cam": {}}, "xml", "", {}),
        ("cam", None, "", "", {"speed": float("nan")}),
        ("cam", bytes(65_536), "", "", {}),
    ],
)
def test_request_with_contradictory_arguments_raises_value_error(
    kind: str, value: Any, form: str, edition: str, fields: dict[str, Any]
):
    with pytest.raises(ValueError, match=r"type|form|fields|speed|octets"):
        outgoing(kind, value, form, edition, None, fields)


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"heading": 90.0, "speed": math.nan}, "speed: nan is not a finite number"),
        ({"speed": -math.inf}, "speed: -inf is not a finite number"),
        ({"cam.x": [1, {"y": (2, math.nan)}]}, r"cam\.x\[1\]\.y\[1\]: nan is not"),
        ({"speed": 1 + 2j}, r"speed: \(1\+2j\) is not a number, text, bool, list or dict"),
        ({"speed": b"13.9"}, "speed: b'13.9' is not"),
        ({"x": {1: {(2, 3): 4}}}, r"x\.1\.\(2, 3\): the name is not a text"),
    ],
)
def test_value_that_json_does_not_have_is_named_with_its_path(fields: dict[str, Any], said: str):
    with pytest.raises(ValueError, match=f"^{said}"):
        outgoing("cam", None, "", "", None, fields)
    with pytest.raises(ValueError, match=f"^{said}"):
        outgoing("cam", fields, "", "", None, {})
    with pytest.raises(ValueError, match=rf"^options\.{said}"):
        Requests().open("cam", outgoing("cam", PDU, "", "", fields, {}))


def test_value_that_contains_itself_raises_value_error():
    ring: dict[str, Any] = {}
    ring["cam"] = ring
    with pytest.raises(ValueError, match="Circular"):
        outgoing("cam", ring, "", "", None, {})


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((2, PDU, "", "", None), "kind: 2 is not a text"),
        ((b"cam", PDU, "", "", None), "kind: b'cam' is not a text"),
        (("cam", "0202", "", "", None), "message: '0202' is not a dict or octets"),
        (("cam", [1], "", "", None), r"message: \[1\] is not"),
        (("cam", None, 1, "", None), "form: 1 is not a text"),
        (("cam", None, "", 1.4, None), "edition: 1.4 is not a text"),
        (("cam", None, "", "", ["g5"]), r"options: \['g5'\] is not a dict"),
    ],
)
def test_argument_of_a_wrong_type_is_named_with_its_value(arguments: Any, said: str):
    with pytest.raises(ValueError, match=f"^{said}"):
        outgoing(*arguments, {})


@pytest.mark.parametrize("options", [{"label": "x" * 65_536}, {"interfaces": ["x" * 65_536]}])
def test_options_that_are_too_long_raise_value_error(options: dict[str, Any]):
    with pytest.raises(ValueError, match=r"^options: \d+ octets; at most 65535"):
        opened(Requests(), **options)


@pytest.mark.parametrize("value", [PDU, {"cam": {}}, None])
def test_request_with_a_form_in_its_options_raises_value_error(value: Any):
    with pytest.raises(ValueError, match="form"):
        outgoing("cam", value, "", "", {"form": "json"}, {})


@pytest.mark.parametrize("label", ["", 0, 7, None])
def test_request_with_an_invalid_label_raises_value_error(label: Any):
    requests = Requests()
    with pytest.raises(ValueError, match="label"):
        opened(requests, label=label)
    assert len(requests) == 0


@pytest.mark.parametrize("value", [b"octets", {1}, {(1, 2): 3}, float("inf")])
def test_request_with_a_value_that_json_does_not_have_raises_value_error(value: Any):
    with pytest.raises(ValueError, match=r"^speed[.:]"):
        outgoing("cam", None, "", "", None, {"speed": value})
    with pytest.raises(ValueError, match=r"^options\.lifetime_s[.:]"):
        opened(Requests(), lifetime_s=value)


def test_label_of_the_user_is_kept_and_may_be_open_once():
    requests = Requests()
    assert opened(requests, label="first").label == "first"
    with pytest.raises(ValueError, match="first"):
        opened(requests, label="first")


# -- confirms


def test_request_is_over_when_each_interface_has_confirmed_it():
    requests = Requests()
    request = opened(requests)
    assert feed(requests, request, "accepted", interfaces=["g5", "v2n"]) is False
    assert feed(requests, request, "sent", interface="g5") is False
    assert feed(requests, request, "dropped", interface="v2n", reason="link-down") is True
    assert request.outcome() == Confirmed("cam", "8bf6d42855cc559f", ("g5",), {"v2n": "link-down"})
    assert len(requests) == 0


def test_request_calls_on_over_once():
    requests = Requests()
    request = opened(requests)
    calls: list[bool] = []
    request.on_over = lambda: calls.append(request.is_over)
    feed(requests, request, "accepted", interfaces=["g5"])
    feed(requests, request, "sent", interface="g5")
    feed(requests, request, "sent", interface="g5")
    assert calls == [True]


def test_request_that_an_interface_confirms_first_is_not_over_before_the_station_accepts_it():
    requests = Requests()
    request = opened(requests)
    assert feed(requests, request, "sent", interface="g5") is False
    assert feed(requests, request, "accepted", interfaces=["g5"]) is True


def test_refused_request_raises_reason_detail_and_all_faults():
    requests = Requests()
    request = opened(requests)
    feed(requests, request, "refused", reason="bad-json", meaning="not a message", detail="cam.x", invalid=INVALID)
    with pytest.raises(RefusedError, match=r"cam: refused: bad-json: cam\.x") as refused:
        request.outcome()
    error = refused.value
    assert (error.reason, error.detail, error.hint) == ("bad-json", "cam.x", "not a message")
    assert error.invalid == tuple(INVALID)


def test_request_that_each_interface_drops_raises_refused():
    requests = Requests()
    request = opened(requests)
    feed(requests, request, "accepted", interfaces=["g5"])
    feed(requests, request, "dropped", interface="g5", reason="expired", meaning="too old", detail="")
    with pytest.raises(RefusedError, match="cam: dropped by g5: expired: too old"):
        request.outcome()


@pytest.mark.parametrize(
    ("confirms", "missing"),
    [([], "no confirm of the station"), ([("accepted", {"interfaces": ["b", "a"]})], "no confirm of a, b")],
)
def test_request_without_all_confirms_raises_unconfirmed_and_names_the_missing_ones(confirms: Any, missing: str):
    requests = Requests()
    request = opened(requests)
    for outcome, more in confirms:
        feed(requests, request, outcome, **more)
    with pytest.raises(UnconfirmedError, match=missing):
        request.outcome()


@pytest.mark.parametrize(
    "frames",
    [[b"confirm.cam."], [b"confirm.cam.", b"no JSON"], [b"confirm.cam.", b"[]"], [b"confirm.cam.", b'{"label": 7}']],
)
def test_malformed_confirm_and_one_of_another_user_end_no_request(frames: list[bytes]):
    requests = Requests()
    opened(requests)
    requests.report(frames)
    assert len(requests) == 1


def test_oldest_request_ends_as_unconfirmed_beyond_the_limit():
    requests = Requests(most=2)
    oldest, *_ = [opened(requests) for _ in range(3)]
    assert len(requests) == 2
    with pytest.raises(UnconfirmedError, match="more than 2 requests are open"):
        oldest.outcome()


JSON = st.recursive(
    st.none() | st.booleans() | st.floats(allow_nan=False) | st.integers() | st.text(max_size=4),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=4), inner, max_size=3),
    max_leaves=4,
)
OUTCOME = st.sampled_from(["accepted", "refused", "sent", "dropped"]) | JSON
KEYS = ("interfaces", "interface", "reason", "meaning", "detail", "invalid", "type", "digest")


@given(confirms=st.lists(st.fixed_dictionaries({"outcome": OUTCOME}, optional=dict.fromkeys(KEYS, JSON)), max_size=4))
def test_confirms_of_random_values_give_an_outcome_or_an_expected_error(confirms: list[dict[str, Any]]):
    requests = Requests()
    request = opened(requests)
    for confirm in confirms:
        requests.report([b"confirm.cam.", json.dumps({**confirm, "label": request.label}).encode()])
    try:
        assert request.outcome().sent
    except (RefusedError, UnconfirmedError) as error:
        assert error.message.startswith("cam: ")


def test_malformed_list_of_interfaces_raises_nothing_in_the_reader():
    requests = Requests()
    feed(requests, opened(requests), "accepted", interfaces=7)
    feed(requests, opened(requests), "refused", invalid=7)


def test_close_ends_all_requests():
    requests = Requests()
    request = opened(requests)
    requests.close()
    with pytest.raises(UnconfirmedError, match="closed"):
        request.outcome()


# -- restarts


def test_new_run_ends_the_requests_of_the_former_run_at_once():
    requests = Requests()
    status(requests, "first")
    former = opened(requests)
    status(requests, "second")
    with pytest.raises(UnconfirmedError, match="restarted"):
        former.outcome()


@pytest.mark.parametrize("runs", [["first"], ["first", "first"]])
def test_status_of_the_same_run_ends_no_request(runs: list[str]):
    requests = Requests()
    request = opened(requests)
    for run in runs:
        status(requests, run)
    assert not request.is_over


def test_request_that_was_sent_after_the_status_of_the_new_run_stays_open():
    requests = Requests()
    status(requests, "first")
    status(requests, "second")
    request = opened(requests)
    status(requests, "second")
    assert not request.is_over
