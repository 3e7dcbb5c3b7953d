"""Topics of own position and time: NavSatFix, TimeReference, PoseStamped, transform."""

from typing import Any

from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped, TransformStamped
from sensor_msgs.msg import NavSatFix, NavSatStatus, TimeReference

from . import own
from .filters import Place
from .own import Pose

# A receiver reports its error with 95 % confidence: that is two standard deviations.
DEVIATIONS_OF_A_BOUND = 2.0
CARRIER = ("float", "fixed")  # carrier-phase solutions, with corrections from a base station


class OwnTopics:
    """Publishes own position and time, once a second. The receiving thread calls its methods.

    origin  origin of the map: latitude, longitude, altitude_m; None: use the first own position.
    """

    def __init__(
        self,
        node: Any,
        frames: tuple[str, str],
        origin: tuple[float, float, float] | None,
        has_transform: bool,
        qos: Any,
    ) -> None:
        self.place: Place | None = None
        self.leap_seconds = 5  # valid since 2017; replaced by the value that the station reports
        self._node = node
        self._map, self._station = frames
        self._origin = origin
        # Last known orientation, because a stopped station has no heading. No pose is published before the first
        # heading.
        self._turn: tuple[float, float] | None = None
        self._fix = qos(NavSatFix, "own/fix")
        self._pose = qos(PoseStamped, "own/pose")
        self._time = qos(TimeReference, "own/time_reference")
        self._transform, self._transforms = None, None
        self._lacking = "" if has_transform else "own.transform is false"
        if has_transform:
            try:
                from tf2_msgs.msg import TFMessage
            except ImportError as error:
                self._lacking = f"tf2_msgs is not installed: {error}"
            else:
                self._transforms = TFMessage
                self._transform = qos(TFMessage, "/tf")

    @property
    def why_no_transform(self) -> str:
        """Reason why no transform is published; empty if it is published."""
        return self._lacking or ("the station's heading was never known so far" if self._turn is None else "")

    def status(self, told: dict[str, Any]) -> None:
        """Publish the position of a status report."""
        pose = own.pose(told)
        if pose is None:
            self.place = None
            return
        self.place = (pose.latitude, pose.longitude)
        stamp = self._node.get_clock().now().to_msg()
        self._fix.publish(self._nav_sat_fix(pose, stamp))
        if self._origin is None:
            self._origin = (*self.place, pose.altitude_m or 0.0)
        east, north, up = own.east_north_up(self._origin, self.place, self._altitude(pose))
        if pose.heading_deg is not None:
            self._turn = own.quaternion(pose.heading_deg)
        if self._turn is not None:
            self._publish_pose(stamp, (east, north, up), self._turn)

    def time(self, told: dict[str, Any]) -> None:
        """Publish the time of a report `time.`."""
        clock = own.clock(told)
        if clock.leap_seconds is not None:
            self.leap_seconds = clock.leap_seconds
        if clock.unix_ns is None:
            return
        message = TimeReference()
        message.header.stamp = self._node.get_clock().now().to_msg()
        message.header.frame_id = self._station
        message.time_ref = Time(sec=clock.unix_ns // 10**9, nanosec=clock.unix_ns % 10**9)
        message.source = clock.source
        self._time.publish(message)

    def _altitude(self, pose: Pose) -> float:
        """Return the altitude in m; that of the origin if the receiver reports none."""
        if pose.altitude_m is not None:
            return pose.altitude_m
        return 0.0 if self._origin is None else self._origin[2]

    def _nav_sat_fix(self, pose: Pose, stamp: Time) -> NavSatFix:
        message = NavSatFix()
        message.header.stamp, message.header.frame_id = stamp, self._station
        is_exact = pose.carrier in CARRIER
        message.status.status = NavSatStatus.STATUS_GBAS_FIX if is_exact else NavSatStatus.STATUS_FIX
        message.status.service = NavSatStatus.SERVICE_GPS
        message.latitude, message.longitude = pose.latitude, pose.longitude
        message.altitude = float("nan") if pose.altitude_m is None else pose.altitude_m
        if pose.horizontal_m is not None:
            across = (pose.horizontal_m / DEVIATIONS_OF_A_BOUND) ** 2
            upward = across if pose.vertical_m is None else (pose.vertical_m / DEVIATIONS_OF_A_BOUND) ** 2
            message.position_covariance = [across, 0.0, 0.0, 0.0, across, 0.0, 0.0, 0.0, upward]
            message.position_covariance_type = NavSatFix.COVARIANCE_TYPE_APPROXIMATED
        return message

    def _publish_pose(self, stamp: Time, place: tuple[float, float, float], turn: tuple[float, float]) -> None:
        message = PoseStamped()
        message.header.stamp, message.header.frame_id = stamp, self._map
        position, orientation = message.pose.position, message.pose.orientation
        position.x, position.y, position.z = place
        orientation.z, orientation.w = turn
        self._pose.publish(message)
        if self._transform is None or self._transforms is None:
            return
        transform = TransformStamped()
        transform.header, transform.child_frame_id = message.header, self._station
        move = transform.transform.translation
        move.x, move.y, move.z = place
        transform.transform.rotation = orientation
        self._transform.publish(self._transforms(transforms=[transform]))
