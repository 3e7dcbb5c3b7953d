"""The Python module of the messages with to_cdr and from_cdr, every profile, as its wheel has it: in build/ros2/wheel*."""

from collections.abc import Iterable
from pathlib import Path

from asn1.backends.backend import Job
from asn1.backends.registry import BACKENDS
from asn1.backends.ros2.model import RosPackage
from asn1.backends.ros2.options import Ros2Options
from asn1.model import text
from tests.proof.ros2 import ros

FEW = 2  # up to so many messages have a module of their own, which is compiled within seconds
RAW_RX = "rawrx-1"  # without it no gateway is


def made(packages: Iterable[RosPackage] = ()) -> Path:
    """Its folder: of these packages' messages and RawRxMessage where they are few, of all otherwise.

    Only what has changed is compiled.
    """
    schema = text.load_schema()
    chosen = tuple(edition for package in packages for edition in package.tops)
    if 0 < len(chosen) <= FEW:
        folder, chosen = ros.MADE / "-".join(("wheel", *chosen)), tuple(dict.fromkeys((*chosen, RAW_RX)))
    else:
        folder, chosen = ros.MADE / "wheel", tuple(schema.messages)
    ros.MADE.mkdir(parents=True, exist_ok=True)
    BACKENDS["wheel"].write(Job(schema, chosen, Ros2Options(with_cdr=True)), folder, lambda name: None)
    return folder
