"""ROS 2 message packages from the schema: which messages, with which fields, and how a field comes from the ASN.1."""


class RosError(ValueError):
    """A message that ROS 2 cannot say; str() tells which, and why."""
