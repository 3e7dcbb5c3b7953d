"""Message packages into a workspace: generated, and built by colcon with ROS's own generators."""

import json
import resource
import shutil
import time
from collections.abc import Iterable, Iterator
from pathlib import Path

from asn1.backends.backend import Job
from asn1.backends.registry import BACKENDS
from asn1.backends.ros2 import profiles
from asn1.backends.ros2.model import RosPackage
from asn1.backends.ros2.options import Ros2Options
from asn1.backends.ros2.rihs import hash_of
from asn1.model import text
from asn1.model.types import Schema
from tests.proof.ros2 import ros
from tests.proof.ros2.rows import Row

SCHEMA: Schema = text.load_schema()
SHORT = ("cam-1.4.1", "denm-1.3.1")
TOGETHER = ros.INSIDE / "together.cmake"


def made(editions: Iterable[str], profile: str = "etsi_its") -> list[RosPackage]:
    """The packages of some editions, as the generator writes them into the workspace."""
    chosen = tuple(editions)
    BACKENDS["ros2"].write(Job(SCHEMA, chosen, Ros2Options(profile)), source(profile), lambda name: None)
    return profiles.packages(SCHEMA, [SCHEMA.messages[name] for name in chosen], profile)


def source(profile: str) -> Path:
    return ros.WORKSPACE / "src" / profile


def build(packages: Iterable[RosPackage]) -> Iterator[Row]:
    """Built, installed, and every message of it made and read by rclpy. One that fails keeps no other from it."""
    for package in packages:
        try:
            yield _built(package)
            yield _used(package)
            yield from (_heard(package, top) for top in package.tops.values())
        except ros.RosError as error:
            yield Row(package.name, "ended early", str(error))


def _built(package: RosPackage) -> Row:
    began, worked = time.monotonic(), _worked_s()
    ros.run(
        [
            ros.ENV / "bin" / "colcon", "build", "--merge-install", "--paths", source(package.profile) / package.name,
            "--cmake-args", "-GNinja", "-DBUILD_TESTING=OFF", "-DCMAKE_C_FLAGS=-O0", "-DCMAKE_CXX_FLAGS=-O0",
            f"-DCMAKE_PROJECT_INCLUDE={TOGETHER}", f"-DPython3_EXECUTABLE={ros.ENV / 'bin' / 'python'}",
        ],
        cwd=ros.WORKSPACE, log=ros.MADE / f"{package.name}.log",
    )  # fmt: skip
    took, work = time.monotonic() - began, _worked_s() - worked
    return Row(f"{package.name} built", f"{len(package.messages)} types, {took:.0f} s, {work:.0f} s of one processor")


def _worked_s() -> float:
    """Of all programs that were run so far: seconds of a processor."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def clean() -> None:
    """Nothing built of an earlier run."""
    for name in ("build", "install", "log"):
        shutil.rmtree(ros.WORKSPACE / name, ignore_errors=True)


def _used(package: RosPackage) -> Row:
    said = ros.inside("use.py", package.name).split()
    count, octets = int(said[0]), int(said[1])
    trouble = "" if count == len(package.messages) else f"{len(package.messages)} were made"
    return Row(f"{package.name} in rclpy", f"{count} types serialised and read again, {octets} octets", trouble)


def _heard(package: RosPackage, top: str) -> Row:
    """Octets of padding are what the writer's memory held: only the length is compared."""
    said = json.loads(ros.inside("talk.py", package.name, top))
    typed, raw = said["typed"], said["raw"]
    trouble = ""
    if said["hash"] != hash_of(package, top):
        trouble = f"discovery tells {said['hash']}"
    elif not typed or not raw or len(typed[0]) != len(raw[0]):
        trouble = "a subscription heard nothing or something else"
    return Row(f"{package.name}/{top} by Fast DDS", "typed and raw subscription, our hash in discovery", trouble)
