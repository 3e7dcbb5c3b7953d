"""captain_gateway: `ros2 run captain_gateway captain_gateway`, `captain ros2`, `python3 -m captain_gateway`."""

import sys

from . import codec
from .errors import GatewayError


def main() -> int:
    """Run the node with the arguments of ROS. Returns 0 interrupted, 1 where something is missing, in words."""
    try:
        library = codec.load()
        try:
            from .node import run
        except ImportError as error:
            raise GatewayError(
                f"{error}: is ROS 2 sourced? It needs rclpy, diagnostic_msgs, geometry_msgs, sensor_msgs and pyzmq"
            ) from error
        run(sys.argv[1:], library)
    except GatewayError as error:
        print(f"captain_gateway: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
