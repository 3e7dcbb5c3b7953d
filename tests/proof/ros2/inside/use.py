"""Every message of a package: made, serialised and read again by rclpy; prints how many, and the octets of all."""

import importlib
import inspect
import sys

from rclpy.serialization import deserialize_message, serialize_message

package = importlib.import_module(f"{sys.argv[1]}.msg")
count = octets = 0
for _, type_ in sorted(inspect.getmembers(package, inspect.isclass)):
    serialised = serialize_message(type_())
    if deserialize_message(serialised, type_) != type_():
        sys.exit(f"{type_.__name__}: another message came back")
    count, octets = count + 1, octets + len(serialised)
print(count, octets)
