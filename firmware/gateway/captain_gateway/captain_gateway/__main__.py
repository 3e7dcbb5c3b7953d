"""Program captain_gateway: `ros2 run captain_gateway captain_gateway`, `captain ros2`, `python3 -m captain_gateway`."""

import sys

from . import codec
from .errors import GatewayError


def main() -> int:
    """Run the node with the arguments of ROS.

    Returns the exit status: 0 after an interrupt, 1 if something is missing; the error is printed.
    """
    try:
        library = codec.load()
        try:
            from .node import run
        except ImportError as error:
            raise GatewayError(
                f"{error}; source ROS 2: rclpy, diagnostic_msgs, geometry_msgs, sensor_msgs and pyzmq are needed"
            ) from error
        run(sys.argv[1:], library)
    except GatewayError as error:
        print(f"captain_gateway: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
