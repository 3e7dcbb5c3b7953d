"""Running gateway: parameters, requests, services, position, and ROS's view."""

import json
import time

from captain_gateway_msgs.msg import Request
from captain_gateway_msgs.srv import Decode, Encode
from etsi_its_cam_msgs.msg import CAM
from rcl_interfaces.srv import DescribeParameters, ListParameters
from rclpy.qos import ReliabilityPolicy
from rclpy.serialization import serialize_message

from tests.proof.ros2.inside.gateway_bench import NAME, OWN, RX, Bench, WrongError

STATUS = {
    "station": "played", "version": "0", "interfaces": {"g5": {"state": "up", "why": ""}},
    "position": {
        "latitude": 47.06, "longitude": 15.47, "source": "gnss", "carrier": "fixed", "altitude_m": 400.0,
        "horizontal_m": 2.0, "vertical_m": 4.0, "heading_deg": 90.0, "speed_m_s": 10.0,
    },
}  # fmt: skip
# 2026-11-22T00:00:00Z in ITS time
TIME = {"its_ms": 722217605000, "leap": {"seconds": 5}, "receiver": "gnss", "state": "locked"}


def introspection(test: Bench) -> str:
    node = test.node
    if ("captain_gateway", "/") not in node.get_node_names_and_namespaces():
        raise WrongError(f"{node.get_node_names_and_namespaces()}")
    topics = dict(node.get_publisher_names_and_types_by_node("captain_gateway", "/"))
    if topics["/cam/received"] != ["etsi_its_cam_msgs/msg/CAM"]:
        raise WrongError(f"{topics}")
    [cam] = node.get_publishers_info_by_topic("/cam/received")
    [denm] = node.get_publishers_info_by_topic("/denm/received")
    if (
        cam.qos_profile.reliability != ReliabilityPolicy.RELIABLE
        or denm.qos_profile.reliability != ReliabilityPolicy.BEST_EFFORT
    ):
        raise WrongError(f"{cam} {denm}")
    services = dict(node.get_service_names_and_types_by_node("captain_gateway", "/"))
    if f"{NAME}/encode" not in services:
        raise WrongError(f"{services}")
    return f"{len(topics)} topics, {len(services)} services by name and type; QoS as it is, and as it was overridden"


def parameters(test: Bench) -> str:
    names = test.call(ListParameters, f"{NAME}/list_parameters", ListParameters.Request()).result.names
    asked = DescribeParameters.Request(names=["cam.transmit.rate_hz", "station.host"])
    rate, host = test.call(DescribeParameters, f"{NAME}/describe_parameters", asked).descriptors
    if not rate.description or not host.read_only:
        raise WrongError(f"{rate} {host}")
    if test.set("station.host", "elsewhere").successful:
        raise WrongError("a read-only parameter was changed")
    refused = test.set("cam.transmit.rate_hz", -3.0)
    if refused.successful or "-3.0 is not a number from 0 to 1000" not in refused.reason:
        raise WrongError(f"{refused}")
    return f"{len(names)} parameters with words; refused: {refused.reason}"


def live(test: Bench) -> str:
    if not test.set("cam.receive.stations", [1337]).successful:
        raise WrongError("not changed")
    test.cams.clear()
    test.station.indicate("cam", test.numbered(1), RX, OWN, "g5")
    test.station.indicate("cam", test.numbered(1337), RX, OWN, "g5")
    test.until(lambda: test.cams, "a CAM of 1337")
    test.spin(0.3)
    if [message.header.station_id.value for message, _ in test.cams] != [1337]:
        raise WrongError("the filter was not changed")
    test.set("cam.receive.stations", [""])
    test.set("cam.transmit.active", False)
    before = len(test.station.taken)
    test.cam.publish(test.typed(test.numbered(5), "cam-1.4.1", CAM))
    test.until_counted("cam", "not sent: inactive", 1)
    test.set("cam.transmit.active", True)
    test.set("station_id", 99)
    test.cam.publish(test.typed(test.numbered(6), "cam-1.4.1", CAM))
    [frames] = test.until(lambda: test.sent_since(before), "a message")
    test.set("station_id", 0)
    if frames[1] != test.numbered(99):
        raise WrongError("its stationID is not the one of the parameter")
    return "stations, active, station_id: changed while it runs"


def rate(test: Bench) -> str:
    """Each of 60 is sent or replaced by a newer one; no more are sent than the rate allows."""
    counted = ("taken", "sent", "not sent: replaced")
    test.set("cam.transmit.rate_hz", 5.0)
    test.spin(1.5)  # what was counted before has been told
    before = {key: test.count("cam", key) for key in counted}
    sent_before, began = len(test.station.taken), time.monotonic()
    for _ in range(60):
        test.cam.publish(test.typed(test.numbered(7000), "cam-1.4.1", CAM))
        test.spin(1 / 30)

    def since() -> list[int]:
        return [test.count("cam", key) - before[key] for key in counted]

    test.until(lambda: since()[0] == 60 == sum(since()[1:]), "60 that were sent or replaced")
    took = time.monotonic() - began
    test.set("cam.transmit.rate_hz", 0.0)
    _, sent, replaced = since()
    if not sent == len(test.sent_since(sent_before)) <= 5 * took + 2 or not replaced:
        raise WrongError(f"{sent} were sent of 60 in {took:.1f} s at 5 Hz, {len(test.sent_since(sent_before))} came")
    return f"60 of a node became {sent} in {took:.1f} s at 5 Hz; replaced: {replaced}"


def requests(test: Bench) -> str:
    pdu = test.numbered(821)
    request = Request(type="cam", label="mine", cdr=serialize_message(test.typed(pdu, "cam-1.4.1", CAM)), lifetime=2.5)
    request.priority_is_present, request.priority = True, 0
    request.area.shape, request.area.latitude, request.area.longitude, request.area.distance_a = 1, 47.0, 200.0, 100
    test.until(test.request.get_subscription_count, "a subscription of requests")
    test.request.publish(request)
    refused = test.until_said("area.longitude: 200 is not in -180..180")
    request.area.longitude, request.hop_limit = 15.0, 3
    before = len(test.station.taken)
    test.request.publish(request)
    [frames] = test.until(lambda: test.sent_since(before), "the request at the endpoint")
    options = json.loads(frames[2])
    label = options.pop("label")
    wanted = {
        "priority": 0, "lifetime_s": 2.5, "hop_limit": 3,
        "area": {"shape": "circle", "latitude": 47.0, "longitude": 15.0, "distance_a": 100},
    }  # fmt: skip
    if frames[1] != pdu or options != wanted:
        raise WrongError(f"{frames}")
    told = {
        "label": label, "type": "cam", "outcome": "refused", "interface": "", "reason": "policy", "meaning": "held back",
        "detail": "", "queue_us": 0, "send_us": 0, "time": time.time(),
    }  # fmt: skip
    test.station.report("confirm.cam.", told)
    confirm = test.until(lambda: test.heard["confirm"] and test.heard["confirm"][-1], "a confirm")
    if (confirm.label, confirm.outcome, confirm.reason) != ("mine", "refused", "policy"):
        raise WrongError(f"{confirm}")
    test.until_diagnosed("cam", "last refused", "refused by the station: policy (held back)")
    return f"options and label arrive, the confirm comes back; {refused}"


def services(test: Bench) -> str:
    for handler, pdu in test.messages.items():
        found = test.call(Decode, f"{NAME}/decode", Decode.Request(pdu=pdu))
        if not found.success:
            raise WrongError(f"{handler}: {found.reason}")
        back = test.call(Encode, f"{NAME}/encode", Encode.Request(type=found.edition, json=found.json))
        if bytes(back.pdu) != pdu:
            raise WrongError(f"{handler}: {back.reason or 'other octets'}")
    cut = test.call(Decode, f"{NAME}/decode", Decode.Request(pdu=test.messages["cam"][:30]))
    bad = test.call(Encode, f"{NAME}/encode", Encode.Request(type="cam", cdr=b"\0\1\0\0\2"))
    none = test.call(Encode, f"{NAME}/encode", Encode.Request(type="can", json="{}"))
    if cut.success or bad.success or none.success or not (cut.reason and bad.reason and "'can'" in none.reason):
        raise WrongError(f"{cut} {bad} {none}")
    return f"{len(test.messages)} messages there and back; refused: {cut.reason}"


def own(test: Bench) -> str:
    def comes() -> bool:
        test.station.report("status.", STATUS)
        test.station.report("time.", TIME)
        test.spin(0.1)
        return all(test.heard[name] for name in ("own/fix", "own/pose", "own/time_reference", "/tf"))

    test.until(comes, "own position and time")
    fix, clock = test.heard["own/fix"][-1], test.heard["own/time_reference"][-1]
    if (fix.latitude, fix.longitude, fix.altitude, fix.position_covariance[0]) != (47.06, 15.47, 400.0, 1.0):
        raise WrongError(f"{fix}")
    if (clock.time_ref.sec, clock.source) != (1795132800, "gnss, locked"):
        raise WrongError(f"{clock}")
    moved = {**STATUS, "position": {**STATUS["position"], "latitude": 47.061}}
    before = len(test.heard["/tf"])
    test.station.report("status.", moved)
    test.until(lambda: len(test.heard["/tf"]) > before, "a transform")
    [transform] = test.heard["/tf"][-1].transforms
    move, turn = transform.transform.translation, transform.transform.rotation
    if not (111.0 < move.y < 111.4 and abs(move.x) < 0.01 and abs(turn.w - 1.0) < 1e-9):
        raise WrongError(f"{transform}")
    return f"NavSatFix, TimeReference, pose; {transform.header.frame_id} -> {transform.child_frame_id}: {move.y:.2f} m north"
