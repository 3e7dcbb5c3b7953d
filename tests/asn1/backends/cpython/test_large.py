"""captain_messages: large messages, several threads, and memory that stays bounded."""

import gc
import sys
import threading

import pytest

from tests.asn1.codec import CAM, CAM_OCTETS, captain_messages, real

RTCMEM = captain_messages.find("rtcmem")
CORRECTIONS = [bytes([number]) * 1023 for number in range(5)]  # 5115 octets: decoded and encoded without the GIL


def rtcmem():
    return {
        "header": {"protocolVersion": 1, "messageID": 13, "stationID": 4_000_000_000},
        "rtcmc": {"msgCnt": 5, "rev": "rtcmRev3", "msgs": list(CORRECTIONS)},
    }


def test_a_large_message_comes_back():
    octets = RTCMEM.encode(rtcmem())
    assert len(octets) > 5 * 1023
    assert RTCMEM.decode(octets) == rtcmem()
    assert RTCMEM.decode(bytearray(octets)) == rtcmem()
    view = RTCMEM.view(octets)
    assert list(view.rtcmc.msgs) == CORRECTIONS
    assert RTCMEM.encode(view) == octets
    assert RTCMEM.from_json(RTCMEM.to_json(octets)) == octets


def test_a_large_message_that_is_wrong_is_explained():
    octets = RTCMEM.encode(rtcmem())
    with pytest.raises(captain_messages.DecodeError) as caught:
        RTCMEM.decode(octets[:-200])
    assert caught.value.path == "rtcmc.msgs[4]"
    value = rtcmem()
    value["rtcmc"]["msgs"][4] += b"x"
    with pytest.raises(captain_messages.EncodeError, match="1024") as refused:
        RTCMEM.encode(value)
    assert refused.value.path == "rtcmc.msgs[4]"


def test_threads_share_messages_and_views():
    octets, mapem = RTCMEM.encode(rtcmem()), captain_messages.find("mapem-2.1.1")
    mapem_octets = real("mapem-2.1.1", 536)
    expected, view = mapem.decode(mapem_octets), mapem.view(mapem_octets)
    wrong: list[object] = []

    def work():
        for _ in range(40):
            large = RTCMEM.decode(octets)
            value = mapem.decode(mapem_octets)
            if large != rtcmem() or value != expected or view.to_dict() != expected:
                wrong.append(value)
            if (
                RTCMEM.encode(large) != octets
                or mapem.encode(value) != mapem_octets
                or mapem.encode(view) != mapem_octets
            ):
                wrong.append(large)

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong


@pytest.mark.parametrize("fill", [0x00, 0x55, 0xAA, 0xFF])
def test_octets_that_promise_much_are_refused(fill):
    for message in captain_messages.all():
        with pytest.raises(captain_messages.DecodeError):
            message.decode(bytes([fill]) * 30_000)


def refused(call, argument):
    try:
        call(argument)
    except ValueError:
        return
    raise AssertionError


def everything():
    value = CAM.decode(CAM_OCTETS)
    CAM.encode(value)
    view = CAM.view(CAM_OCTETS)
    view.cam.camParameters.highFrequencyContainer.value.to_dict()
    dir(view), repr(view), view == CAM.view(CAM_OCTETS)
    CAM.explain(CAM_OCTETS), CAM.text(CAM_OCTETS), CAM.type_tree().fields
    CAM.from_json(CAM.to_json(CAM_OCTETS))
    CAM.validate(value)
    refused(CAM.decode, CAM_OCTETS[:-1])
    refused(CAM.view, CAM_OCTETS + b"x")
    refused(CAM.encode, value | {"x": object()})
    refused(CAM.encode, {"header": {"protocolVersion": 1.5}})
    refused(CAM.from_json, '{"x": 1}')


def test_no_object_is_left_behind():
    for _ in range(1000):  # the interpreter's own caches fill: 270 blocks, most of them in the first thousand rounds
        everything()
    gc.collect()
    before = sys.getallocatedblocks()
    for _ in range(500):
        everything()
    gc.collect()
    assert sys.getallocatedblocks() - before < 100
