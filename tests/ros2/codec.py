"""The Python module of the messages with to_cdr and from_cdr, in build/ros2/codec: all messages, every profile."""

from pathlib import Path

from asn1 import library, text
from tests.ros2 import ros

FOLDER = ros.MADE / "codec"


def made() -> Path:
    """Its folder; only what has changed is compiled."""
    schema = text.load_schema()
    ros.MADE.mkdir(parents=True, exist_ok=True)
    library.generate(schema, tuple(schema.messages), "python", FOLDER, lambda name: None, library.Ros2(with_cdr=True))
    return FOLDER
