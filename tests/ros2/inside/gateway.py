"""A gateway between a played station and a real node: every way, and everything bad that may come by either.

    gateway.py PORTS MESSAGES [OTHER]

PORTS: JSON, names of the endpoint's ports. MESSAGES: a JSON file, handler -> octets in hexadecimal. OTHER: a prefix with
another definition of CAM. Prints JSON: [what, what was found, trouble] of each.
"""

import contextlib
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[3]
sys.path.append(str(ROOT))

import captain_messages  # noqa: E402
import rclpy  # noqa: E402
from captain_gateway_msgs.msg import Confirm, Metadata, Request  # noqa: E402
from captain_gateway_msgs.srv import Decode, Encode  # noqa: E402
from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402
from etsi_its_cam_msgs.msg import CAM  # noqa: E402
from etsi_its_denm_msgs.msg import DENM  # noqa: E402
from geometry_msgs.msg import PoseStamped  # noqa: E402
from rcl_interfaces.msg import Log, Parameter, ParameterType, ParameterValue  # noqa: E402
from rcl_interfaces.srv import DescribeParameters, ListParameters, SetParameters  # noqa: E402
from rclpy.qos import QoSProfile, ReliabilityPolicy  # noqa: E402
from rclpy.serialization import deserialize_message, serialize_message  # noqa: E402
from sensor_msgs.msg import NavSatFix, TimeReference  # noqa: E402
from tf2_msgs.msg import TFMessage  # noqa: E402

from drivers.message import Position, RxInfo  # noqa: E402
from tests.ros2.inside.gateway_station import Played  # noqa: E402

PATIENCE_S = 30.0
NAME = "/captain_gateway"
RX = RxInfo(
    btp_port=2001, rssi_dbm=-71, data_rate=12, traffic_class=2, hop_limit=3,
    position=Position(470585000, 154600000), source_mac=bytes.fromhex("020304050607"),
)  # fmt: skip
OWN = Position(470600000, 154700000)
STATUS = {
    "station": "played", "version": "0", "interfaces": {"g5": {"state": "up", "why": ""}},
    "position": {
        "latitude": 47.06, "longitude": 15.47, "source": "gnss", "carrier": "fixed", "altitude_m": 400.0,
        "horizontal_m": 2.0, "vertical_m": 4.0, "heading_deg": 90.0, "speed_m_s": 10.0,
    },
}  # fmt: skip
# 2026-11-22T00:00:00Z in ITS time
TIME = {"its_ms": 722217605000, "leap": {"seconds": 5}, "receiver": "gnss", "state": "locked"}

# JSON that a station does not say: a time that no ROS has, half of a character, numbers of other types.
HOSTILE = (
    b'{"its_ms": 1152921504606846976, "leap": {"seconds": 5}}',
    b'{"station": "\\ud800", "interfaces": {"g5": {"state": "\\ud800"}}, "position": {"source": "\\ud800"}}',
    b'{"digest": "0011223344556677", "interface": "g5", "received_ns": 1e999, "btp_port": 1e9, "source": []}',
    b'{"position": {"latitude": 1e308, "longitude": -1e308, "source": "x", "altitude_m": 1e308, "heading_deg": 1e308}}',
    b'{"interfaces": [1, 2], "position": 7, "leap": 7}',
)


class WrongError(Exception):
    """A goal that is not met."""


class Test:
    def __init__(self, ports: dict[str, int], messages: dict[str, bytes]) -> None:
        self.messages = messages
        self.station = Played(ports)
        self.node = rclpy.create_node("test")
        self.cams: list[tuple[Any, dict[str, int]]] = []
        self.denms: list[Any] = []
        self.heard: dict[str, list[Any]] = {}
        self.said: list[str] = []
        self.diagnostics: dict[str, Any] = {}
        node = self.node
        node.create_subscription(CAM, "cam/received", lambda message, info: self.cams.append((message, info)), 100)
        node.create_subscription(
            DENM, "denm/received", self.denms.append, QoSProfile(depth=9, reliability=ReliabilityPolicy.BEST_EFFORT)
        )
        node.create_subscription(Log, "/rosout", lambda log: self.said.append(log.msg), 1000)
        node.create_subscription(DiagnosticArray, "/diagnostics", self._diagnosed, 10)
        for name, type_ in (
            ("cam/received/metadata", Metadata), ("confirm", Confirm), ("own/fix", NavSatFix), ("own/pose", PoseStamped),
            ("own/time_reference", TimeReference), ("/tf", TFMessage),
        ):  # fmt: skip
            self.heard[name] = []
            node.create_subscription(type_, name, self.heard[name].append, 100)
        self.cam = node.create_publisher(CAM, "cam/transmitted", 100)
        self.denm = node.create_publisher(DENM, "denm/transmitted", 100)
        self.request = node.create_publisher(Request, "request", 100)

    def _diagnosed(self, array: Any) -> None:
        for status in array.status:
            self.diagnostics[status.name.partition(": ")[2]] = status

    # -- waiting

    def spin(self, seconds: float) -> None:
        ends = time.monotonic() + seconds
        while time.monotonic() < ends:
            self.station.turn()
            rclpy.spin_once(self.node, timeout_sec=0.02)

    def until(self, holds: Callable[[], Any], what: str) -> Any:
        ends = time.monotonic() + PATIENCE_S
        while not (found := holds()):
            if time.monotonic() > ends:
                raise WrongError(f"{what}: never; last said: {self.said[-2:]}")
            self.station.turn()
            rclpy.spin_once(self.node, timeout_sec=0.02)
        return found

    def call(self, type_: Any, name: str, request: Any) -> Any:
        client = self.node.create_client(type_, name)
        self.until(client.service_is_ready, f"service {name}")
        future = client.call_async(request)
        self.until(future.done, f"answer of {name}")
        return future.result()

    def set(self, name: str, value: Any) -> Any:
        made = ParameterValue()
        kinds = {bool: "bool", int: "integer", float: "double", str: "string"}
        if isinstance(value, list):
            kind = {int: "integer_array", float: "double_array", str: "string_array"}[type(value[0])]
        else:
            kind = kinds[type(value)]
        made.type = getattr(ParameterType, f"PARAMETER_{kind.upper()}")
        setattr(made, f"{kind}_value", value)
        asked = SetParameters.Request(parameters=[Parameter(name=name, value=made)])
        return self.call(SetParameters, f"{NAME}/set_parameters", asked).results[0]

    def diagnosed(self, name: str, key: str) -> str:
        status = self.diagnostics.get(name)
        values = {} if status is None else {pair.key: pair.value for pair in status.values}
        return values.get(key, "")

    def until_said(self, words: str) -> str:
        return str(
            self.until(lambda: next((line for line in self.said if words in line), None), f"a line with {words!r}")
        )

    def until_diagnosed(self, name: str, key: str, words: str) -> str:
        self.until(
            lambda: words in self.diagnosed(name, key),
            f"{key} of {name} with {words!r}, not {self.diagnosed(name, key)!r}",
        )
        return self.diagnosed(name, key)

    def typed(self, pdu: bytes, edition: str, type_: Any) -> Any:
        return deserialize_message(captain_messages.find(edition).to_cdr(pdu)[0], type_)

    def numbered(self, number: int) -> bytes:
        cam = self.messages["cam"]
        return cam[:2] + number.to_bytes(4, "big") + cam[6:]

    def sent_since(self, before: int) -> list[list[bytes]]:
        return self.station.taken[before:]

    # -- what is looked at

    def connect(self) -> str:
        self.until(
            lambda: self.cam.get_subscription_count() and self.denm.get_subscription_count(), "the gateway's topics"
        )
        self.until(
            lambda: self.diagnostics["station"].level != b"\2" if "station" in self.diagnostics else False, "a station"
        )

        def comes() -> bool:  # all subscriptions have travelled when a message and its metadata come
            self.station.indicate("cam", self.numbered(1), RX, OWN, "g5")
            self.spin(0.1)
            return bool(self.cams and self.heard["cam/received/metadata"])

        self.until(comes, "a first message")
        self.spin(0.5)
        return "node, topics and station are there"

    def receive(self) -> str:
        self.cams.clear()
        pdu = self.numbered(4711)
        self.station.indicate("cam", pdu, RX, OWN, "g5")
        message, _ = self.until(lambda: self.cams and self.cams[-1], "a CAM")
        if message != self.typed(pdu, "cam-1.4.1", CAM):
            raise WrongError("another message came")
        return "a typed subscription has the message"

    def metadata(self) -> str:
        notes = self.heard["cam/received/metadata"]
        notes.clear()
        self.cams.clear()
        pdu = self.numbered(4712)
        received_ns = self.station.indicate("cam", pdu, RX, OWN, "g5")
        note = self.until(lambda: next((one for one in notes if one.station_id == 4712), None), "metadata")
        _, info = self.until(lambda: self.cams and self.cams[-1], "a CAM")
        stamp = note.header.stamp.sec * 10**9 + note.header.stamp.nanosec
        own = note.station_time.sec * 10**9 + note.station_time.nanosec
        wanted = {
            "sequence": info["publication_sequence_number"], "station_id": 4712, "btp_port": 2001, "rssi_dbm": -71,
            "data_rate": 12, "message_id": 2, "protocol_version": pdu[0], "traffic_class": 2, "remaining_hop_limit": 3,
            "edition": "cam-1.4.1", "interface": "g5", "source": "02:03:04:05:06:07", "own_latitude": 47.06,
            "own_longitude": 15.47, "sender_latitude": 47.0585, "sender_longitude": 15.46,
        }  # fmt: skip
        for name, value in wanted.items():
            if getattr(note, name) != value:
                raise WrongError(f"{name} is {getattr(note, name)!r}, not {value!r}")
        if (
            (stamp, own) != (received_ns, received_ns + 1_000_000)
            or bytes(note.pdu) != pdu
            or bytes(note.source_mac) != RX.source_mac
        ):
            raise WrongError(f"times, octets or address: {note}")
        return "every field; its sequence is the publication's number"

    def metadata_alone(self) -> str:
        notes = self.heard["cam/received/metadata"]
        notes.clear()
        began = time.monotonic()
        self.station.indicate("cam", self.numbered(4713), RX, OWN, None)
        note = self.until(lambda: next((one for one in notes if one.station_id == 4713), None), "metadata")
        if note.interface or note.btp_port or note.rssi_dbm != -71:
            raise WrongError(f"{note}")
        return f"without an indication after {1000 * (time.monotonic() - began):.0f} ms, with what RawRxMessage has"

    def transmit(self) -> str:
        before = len(self.station.taken)
        pdu = self.numbered(815)
        self.cam.publish(self.typed(pdu, "cam-1.4.1", CAM))
        [frames] = self.until(lambda: self.sent_since(before), "a message at the endpoint")
        if frames[:2] != [b"v2x.", pdu] or "label" not in json.loads(frames[2]):
            raise WrongError(f"{frames}")
        return "a typed publisher's message is at the endpoint, octet for octet"

    def left_out(self) -> str:
        pdu = self.messages["denm"]

        def comes() -> bool:
            self.station.indicate("denm", pdu, RX, OWN, "g5")
            self.spin(0.1)
            return bool(self.denms)

        self.until(comes, "a DENM")
        before = len(self.station.taken)
        self.denm.publish(self.denms[-1])
        [frames] = self.until(lambda: self.sent_since(before), "the DENM at the endpoint")
        bare = captain_messages.find("denm-1.3.1").from_cdr(captain_messages.find("denm-1.3.1").to_cdr(pdu)[0])
        if frames[1] != pdu or bare == pdu:
            raise WrongError("what had no field was not kept")
        return "a DENM with a part without a field goes out again as it came"

    def out_of_range(self) -> str:
        before = len(self.station.taken)
        message = self.typed(self.numbered(816), "cam-1.4.1", CAM)
        message.cam.cam_parameters.basic_container.reference_position.latitude.value = 2000000000
        self.cam.publish(message)
        line = self.until_said("latitude.value")
        self.until_diagnosed("cam", "not sent: out-of-range", "1")
        self.until_diagnosed("cam", "last not sent", "2000000000 is not in -900000000..900000001")
        if self.sent_since(before):
            raise WrongError("something was sent")
        return line

    def foreign(self) -> str:
        # Not empty ones: Fast DDS delivers nothing of a publisher any more once it has sent one.
        before_that = self.refused()
        cdr = serialize_message(self.typed(self.numbered(817), "cam-1.4.1", CAM))
        before = len(self.station.taken)
        for octets in (
            cdr[:20],
            b"\0",
            cdr + bytes(8),
            b"\0\0" + cdr[2:],
            os.urandom(300),
            b"\0\1\0\0" + b"\xff" * 300,
        ):
            self.cam.publish(octets)
        self.until(lambda: self.refused() >= before_that + 6, "all are refused")
        if self.sent_since(before):
            raise WrongError("something was sent")
        return f"{self.diagnosed('cam', 'not sent: foreign')} refused; {self.diagnosed('cam', 'last not sent')}"

    def refused(self) -> int:
        """So many CAMs were no CAMs, or had a value that is none."""
        return sum(int(self.diagnosed("cam", f"not sent: {cause}") or 0) for cause in ("foreign", "out-of-range"))

    def header(self) -> str:
        before = len(self.station.taken)
        message = self.typed(self.numbered(818), "cam-1.4.1", CAM)
        message.header.message_id = 1
        self.cam.publish(message)
        line = self.until_said("header.message_id: 1 is not that of cam: 2")
        if self.sent_since(before):
            raise WrongError("something was sent")
        return line

    def other_type(self) -> str:
        with self.other("import std_msgs.msg as m", "m.String, '/cam/transmitted', 10)", "m.String()"):
            line = self.until_said("other has it as std_msgs/msg/String")
            self.until(lambda: self.diagnostics["cam"].level == b"\1", "a warning in diagnostics")
        self.until(lambda: self.diagnostics["cam"].level == b"\0", "no warning any more")
        return line

    def other_hash(self, prefix: str) -> str:
        with self.other(
            "import etsi_its_cam_msgs.msg as m", "m.CAM, '/cam/transmitted', 10)", "m.CAM(whatever=7)", prefix
        ):
            return self.until_said("other has another definition of etsi_its_cam_msgs/msg/CAM: RIHS01_")

    @contextlib.contextmanager
    def other(self, imports: str, publisher: str, message: str, prefix: str = "") -> Iterator[None]:
        """A node in a process of its own, which publishes ten times a second. prefix: what it finds first."""
        environment = dict(os.environ)
        for name, place in (
            ("AMENT_PREFIX_PATH", ""), ("LD_LIBRARY_PATH", "/lib"), ("PYTHONPATH", f"/lib/{PYTHON}/site-packages"),
        ):  # fmt: skip
            environment[name] = f"{prefix}{place}:{environment[name]}" if prefix else environment[name]
        script = (
            f"import rclpy, time\n{imports}\nrclpy.init()\nnode = rclpy.create_node('other')\n"
            f"publisher = node.create_publisher({publisher}\n"
            f"while True:\n    publisher.publish({message})\n    time.sleep(0.1)\n"
        )
        with subprocess.Popen([sys.executable, "-c", script], env=environment) as child:
            try:
                yield
            finally:
                child.kill()

    def undecodable(self) -> str:
        self.station.indicate("cam", self.messages["cam"][:30], RX, OWN, "g5")
        self.until_diagnosed("cam", "not published: undecodable", "1")
        return self.until_said("cam/received: not published")

    def rubbish(self) -> str:
        before = int(self.until(lambda: self.diagnosed("station", "rubbish"), "a count of rubbish"))
        for frames in (
            [b"v2x.cam."],
            [b"a", b"b", b"c"],
            [b"raw.", b"\xff\xff"],
            [b"nonsense", b""],
            [b"v2x.cam.", b"\2\2"],
            [b"v2x.cam.", b""],
        ):
            self.station.users(*frames)
        for octets in (b"{", b"[]", b"\xff", b'{"digest": 5}', b'{"label": {}}', *HOSTILE):
            for topic in (b"indication.cam.", b"confirm.cam.", b"status.", b"time."):
                self.station._report.send_multipart([topic, octets])
        # Four of the users' port; of the report port 12 that are no object, 6 that are no indication, 4 with half of a pair.
        wanted = str(before + 26)
        self.until(lambda: self.diagnosed("station", "rubbish") == wanted, f"{wanted} counted as rubbish")
        return f"26 counted, and the node lives; without a handler: {self.diagnosed('station', 'without a handler: too short')}"

    def gone_and_back(self) -> str:
        self.station.close()
        line = self.until_said("is silent: no heartbeat for 3 s")
        self.cam.publish(self.typed(self.numbered(819), "cam-1.4.1", CAM))
        self.until_diagnosed("cam", "not sent: no-station", "1")
        self.until(lambda: self.diagnostics["station"].level == b"\2", "an error in diagnostics")
        self.said.clear()
        self.station.open()
        self.until_said("a station is heard at")
        before = len(self.station.taken)

        def arrives() -> bool:
            self.cam.publish(self.typed(self.numbered(820), "cam-1.4.1", CAM))
            self.spin(0.1)
            return bool(self.sent_since(before))

        self.until(arrives, "a message at the endpoint that is back")
        self.spin(1.5)
        return line

    def parameters(self) -> str:
        names = self.call(ListParameters, f"{NAME}/list_parameters", ListParameters.Request()).result.names
        asked = DescribeParameters.Request(names=["cam.transmit.rate_hz", "station.host"])
        rate, host = self.call(DescribeParameters, f"{NAME}/describe_parameters", asked).descriptors
        if not rate.description or not host.read_only:
            raise WrongError(f"{rate} {host}")
        if self.set("station.host", "elsewhere").successful:
            raise WrongError("a read-only parameter was changed")
        refused = self.set("cam.transmit.rate_hz", -3.0)
        if refused.successful or "-3.0 is no number of 0 ... 1000" not in refused.reason:
            raise WrongError(f"{refused}")
        return f"{len(names)} parameters with words; refused: {refused.reason}"

    def live(self) -> str:
        if not self.set("cam.receive.stations", [1337]).successful:
            raise WrongError("not changed")
        self.cams.clear()
        self.station.indicate("cam", self.numbered(1), RX, OWN, "g5")
        self.station.indicate("cam", self.numbered(1337), RX, OWN, "g5")
        self.until(lambda: self.cams, "a CAM of 1337")
        self.spin(0.3)
        if [message.header.station_id.value for message, _ in self.cams] != [1337]:
            raise WrongError("the filter was not changed")
        self.set("cam.receive.stations", [""])
        self.set("cam.transmit.active", False)
        before = len(self.station.taken)
        self.cam.publish(self.typed(self.numbered(5), "cam-1.4.1", CAM))
        self.until_diagnosed("cam", "not sent: inactive", "1")
        self.set("cam.transmit.active", True)
        self.set("station_id", 99)
        self.cam.publish(self.typed(self.numbered(6), "cam-1.4.1", CAM))
        [frames] = self.until(lambda: self.sent_since(before), "a message")
        self.set("station_id", 0)
        if frames[1] != self.numbered(99):
            raise WrongError("its stationID is not the one of the parameter")
        return "stations, active, station_id: changed while it runs"

    def rate(self) -> str:
        self.set("cam.transmit.rate_hz", 5.0)
        self.spin(0.3)
        before = len(self.station.taken)
        began = time.monotonic()
        for _ in range(60):
            self.cam.publish(self.typed(self.numbered(7000), "cam-1.4.1", CAM))
            self.spin(1 / 30)
        self.spin(0.5)
        count, took = len(self.sent_since(before)), time.monotonic() - began
        self.set("cam.transmit.rate_hz", 0.0)
        if not 2 * took <= count <= 5 * took + 2:
            raise WrongError(f"{count} were sent of 60 in {took:.1f} s at 5 Hz")
        replaced = self.diagnosed("cam", "not sent: replaced")
        return f"60 of a node became {count} in {took:.1f} s at 5 Hz; replaced: {replaced}"

    def requests(self) -> str:
        pdu = self.numbered(821)
        request = Request(
            type="cam", label="mine", cdr=serialize_message(self.typed(pdu, "cam-1.4.1", CAM)), lifetime=2.5
        )
        request.priority_is_present, request.priority = True, 0
        request.area.shape, request.area.latitude, request.area.longitude, request.area.distance_a = 1, 47.0, 200.0, 100
        self.until(self.request.get_subscription_count, "a subscription of requests")
        self.request.publish(request)
        refused = self.until_said("area.longitude: 200 is not in -180..180")
        request.area.longitude, request.hop_limit = 15.0, 3
        before = len(self.station.taken)
        self.request.publish(request)
        [frames] = self.until(lambda: self.sent_since(before), "the request at the endpoint")
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
        self.station.report("confirm.cam.", told)
        confirm = self.until(lambda: self.heard["confirm"] and self.heard["confirm"][-1], "a confirm")
        if (confirm.label, confirm.outcome, confirm.reason) != ("mine", "refused", "policy"):
            raise WrongError(f"{confirm}")
        self.until_diagnosed("cam", "last refused", "refused by the station: policy (held back)")
        return f"options and label arrive, the confirm comes back; {refused}"

    def services(self) -> str:
        for handler, pdu in self.messages.items():
            found = self.call(Decode, f"{NAME}/decode", Decode.Request(pdu=pdu))
            if not found.success:
                raise WrongError(f"{handler}: {found.reason}")
            back = self.call(Encode, f"{NAME}/encode", Encode.Request(type=found.edition, json=found.json))
            if bytes(back.pdu) != pdu:
                raise WrongError(f"{handler}: {back.reason or 'other octets'}")
        cut = self.call(Decode, f"{NAME}/decode", Decode.Request(pdu=self.messages["cam"][:30]))
        bad = self.call(Encode, f"{NAME}/encode", Encode.Request(type="cam", cdr=b"\0\1\0\0\2"))
        none = self.call(Encode, f"{NAME}/encode", Encode.Request(type="can", json="{}"))
        if cut.success or bad.success or none.success or not (cut.reason and bad.reason and "'can'" in none.reason):
            raise WrongError(f"{cut} {bad} {none}")
        return f"{len(self.messages)} messages there and back; refused: {cut.reason}"

    def own(self) -> str:
        def comes() -> bool:
            self.station.report("status.", STATUS)
            self.station.report("time.", TIME)
            self.spin(0.1)
            return all(self.heard[name] for name in ("own/fix", "own/pose", "own/time_reference", "/tf"))

        self.until(comes, "own position and time")
        fix, clock = self.heard["own/fix"][-1], self.heard["own/time_reference"][-1]
        if (fix.latitude, fix.longitude, fix.altitude, fix.position_covariance[0]) != (47.06, 15.47, 400.0, 1.0):
            raise WrongError(f"{fix}")
        if (clock.time_ref.sec, clock.source) != (1795132800, "gnss, locked"):
            raise WrongError(f"{clock}")
        moved = {**STATUS, "position": {**STATUS["position"], "latitude": 47.061}}
        before = len(self.heard["/tf"])
        self.station.report("status.", moved)
        self.until(lambda: len(self.heard["/tf"]) > before, "a transform")
        [transform] = self.heard["/tf"][-1].transforms
        move, turn = transform.transform.translation, transform.transform.rotation
        if not (111.0 < move.y < 111.4 and abs(move.x) < 0.01 and abs(turn.w - 1.0) < 1e-9):
            raise WrongError(f"{transform}")
        return f"NavSatFix, TimeReference, pose; {transform.header.frame_id} -> {transform.child_frame_id}: {move.y:.2f} m north"

    def introspection(self) -> str:
        node = self.node
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
        return (
            f"{len(topics)} topics, {len(services)} services by name and type; QoS as it is, and as it was overridden"
        )


PYTHON = f"python{sys.version_info.major}.{sys.version_info.minor}"
STEPS = (
    "connect", "receive", "metadata", "metadata_alone", "transmit", "left_out", "introspection", "parameters", "live", "rate",
    "requests", "services", "own", "out_of_range", "foreign", "header", "other_type", "other_hash", "undecodable", "rubbish",
    "gone_and_back", "receive", "transmit",
)  # fmt: skip


def main(ports: dict[str, int], messages: dict[str, bytes], other: str) -> None:
    rclpy.init()
    test = Test(ports, messages)
    rows = []
    for name in STEPS:
        if name == "other_hash" and not other:
            continue
        test.said.clear() if name != "connect" else None
        try:
            found, trouble = getattr(test, name)(*([other] if name == "other_hash" else [])), ""
        except WrongError as wrong:
            found, trouble = "", str(wrong)
        rows.append([name.replace("_", " "), found, trouble])
        print(rows[-1], file=sys.stderr, flush=True)
    print(json.dumps(rows))


if __name__ == "__main__":
    main(
        json.loads(sys.argv[1]),
        {name: bytes.fromhex(octets) for name, octets in json.loads(Path(sys.argv[2]).read_text()).items()},
        sys.argv[3] if len(sys.argv) > 3 else "",
    )
