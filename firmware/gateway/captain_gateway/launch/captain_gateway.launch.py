"""Launch file: starts the gateway with a parameter file.

No test runs it, because no package index has the package launch.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare


def generate_launch_description() -> LaunchDescription:
    usual = PathJoinSubstitution([FindPackageShare("captain_gateway"), "config", "captain_gateway.yaml"])
    return LaunchDescription([
        DeclareLaunchArgument("params_file", default_value=usual),
        DeclareLaunchArgument("host", default_value="127.0.0.1"),
        Node(
            package="captain_gateway",
            executable="captain_gateway",
            parameters=[LaunchConfiguration("params_file"), {"station.host": LaunchConfiguration("host")}],
        ),
    ])  # fmt: skip
