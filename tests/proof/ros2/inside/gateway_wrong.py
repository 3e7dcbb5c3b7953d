"""Everything bad that may come by either side of a gateway."""

import contextlib
import os
import random
import subprocess
import sys
from collections.abc import Iterator

from etsi_its_cam_msgs.msg import CAM
from rclpy.serialization import serialize_message

from tests.proof.ros2.inside.gateway_bench import OWN, RX, Bench, WrongError

PYTHON = f"python{sys.version_info.major}.{sys.version_info.minor}"
# JSON that a station does not say: a time that no ROS has, half of a character, numbers of other types.
HOSTILE = (
    b'{"its_ms": 1152921504606846976, "leap": {"seconds": 5}}',
    b'{"station": "\\ud800", "interfaces": {"g5": {"state": "\\ud800"}}, "position": {"source": "\\ud800"}}',
    b'{"digest": "0011223344556677", "interface": "g5", "received_ns": 1e999, "btp_port": 1e9, "source": []}',
    b'{"position": {"latitude": 1e308, "longitude": -1e308, "source": "x", "altitude_m": 1e308, "heading_deg": 1e308}}',
    b'{"interfaces": [1, 2], "position": 7, "leap": 7}',
)


def out_of_range(test: Bench) -> str:
    before = len(test.station.taken)
    message = test.typed(test.numbered(816), "cam-1.4.1", CAM)
    message.cam.cam_parameters.basic_container.reference_position.latitude.value = 2000000000
    test.cam.publish(message)
    line = test.until_said("latitude.value")
    test.until_counted("cam", "not sent: out-of-range", 1)
    test.until_diagnosed("cam", "last not sent", "2000000000 is not in -900000000..900000001")
    if test.sent_since(before):
        raise WrongError("something was sent")
    return line


def foreign(test: Bench) -> str:
    # Not empty ones: Fast DDS delivers nothing of a publisher any more once it has sent one.
    before_that = _refused(test)
    cdr = serialize_message(test.typed(test.numbered(817), "cam-1.4.1", CAM))
    before = len(test.station.taken)
    for octets in (
        cdr[:20],
        b"\0",
        cdr + bytes(8),
        b"\0\0" + cdr[2:],
        random.Random(300).randbytes(300),
        b"\0\1\0\0" + b"\xff" * 300,
    ):
        test.cam.publish(octets)
    test.until(lambda: _refused(test) >= before_that + 6, "all are refused")
    if test.sent_since(before):
        raise WrongError("something was sent")
    return f"{test.diagnosed('cam', 'not sent: foreign')} refused; {test.diagnosed('cam', 'last not sent')}"


def _refused(test: Bench) -> int:
    """So many CAMs were no CAMs, or had a value that is none."""
    return sum(test.count("cam", f"not sent: {cause}") for cause in ("foreign", "out-of-range"))


def header(test: Bench) -> str:
    before = len(test.station.taken)
    message = test.typed(test.numbered(818), "cam-1.4.1", CAM)
    message.header.message_id = 1
    test.cam.publish(message)
    line = test.until_said("header.message_id: 1 is not that of cam: 2")
    if test.sent_since(before):
        raise WrongError("something was sent")
    return line


def other_type(test: Bench) -> str:
    with _other("import std_msgs.msg as m", "m.String, '/cam/transmitted', 10)", "m.String()"):
        line = test.until_said("other has it as std_msgs/msg/String")
        test.until(lambda: test.diagnostics["cam"].level == b"\1", "a warning in diagnostics")
    test.until(lambda: test.diagnostics["cam"].level == b"\0", "no warning any more")
    return line


def other_hash(test: Bench) -> str:
    with _other("import etsi_its_cam_msgs.msg as m", "m.CAM, '/cam/transmitted', 10)", "m.CAM(whatever=7)", test.other):
        return test.until_said("other has another definition of etsi_its_cam_msgs/msg/CAM: RIHS01_")


@contextlib.contextmanager
def _other(imports: str, publisher: str, message: str, prefix: str = "") -> Iterator[None]:
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


def undecodable(test: Bench) -> str:
    test.station.indicate("cam", test.messages["cam"][:30], RX, OWN, "g5")
    test.until_counted("cam", "not published: undecodable", 1)
    return test.until_said("cam/received: not published")


def rubbish(test: Bench) -> str:
    before = int(test.until(lambda: test.diagnosed("station", "rubbish"), "a count of rubbish"))
    for frames in (
        [b"v2x.cam."],
        [b"a", b"b", b"c"],
        [b"raw.", b"\xff\xff"],
        [b"nonsense", b""],
        [b"v2x.cam.", b"\2\2"],
        [b"v2x.cam.", b""],
    ):
        test.station.users(*frames)
    for octets in (b"{", b"[]", b"\xff", b'{"digest": 5}', b'{"label": {}}', *HOSTILE):
        for topic in (b"indication.cam.", b"confirm.cam.", b"status.", b"time."):
            test.station._report.send_multipart([topic, octets])
    # Four of the users' port; of the report port 12 that are no object, 6 that are no indication, 4 with half of a pair.
    test.until_counted("station", "rubbish", before + 26)
    return f"26 counted, and the node lives; without a handler: {test.diagnosed('station', 'without a handler: too short')}"


def gone_and_back(test: Bench) -> str:
    test.station.close()
    line = test.until_said("is silent: no heartbeat for 3 s")
    test.cam.publish(test.typed(test.numbered(819), "cam-1.4.1", CAM))
    test.until_counted("cam", "not sent: no-station", 1)
    test.until(lambda: test.diagnostics["station"].level == b"\2", "an error in diagnostics")
    test.said.clear()
    test.station.open()
    test.until_said("a station is heard at")
    before = len(test.station.taken)

    def arrives() -> bool:
        test.cam.publish(test.typed(test.numbered(820), "cam-1.4.1", CAM))
        test.spin(0.1)
        return bool(test.sent_since(before))

    test.until(arrives, "a message at the endpoint that is back")
    test.spin(1.5)
    return line
