"""The ROS 2 of the bench: Jazzy as wheels in build/ros2/env (.ci/ros2), and what is built for it."""

import os
import subprocess
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
MADE = ROOT / "build" / "ros2"
ENV = MADE / "env"
WORKSPACE = MADE / "workspace"
INSTALLED = WORKSPACE / "install"
INSIDE = Path(__file__).parent / "inside"
DOMAIN = "77"  # of ROS: no node of somebody else is met; ROS_DOMAIN_ID is another, for two runs on one machine


class RosError(RuntimeError):
    """A program of ROS failed; str() is the end of what it said."""


def environment(prefix: Path = INSTALLED) -> dict[str, str]:
    """As if ROS and the workspace, or what else is installed at prefix, were sourced, and nothing of whoever calls."""
    [site] = (ENV / "lib").glob("python3.*")
    return {
        "HOME": os.environ.get("HOME", "/"),
        "PATH": f"{ENV / 'bin'}:/usr/local/bin:/usr/bin:/bin",
        "LANG": "C.UTF-8",
        "AMENT_PREFIX_PATH": f"{prefix}:{ENV}",
        "CMAKE_PREFIX_PATH": str(ENV),
        "LD_LIBRARY_PATH": f"{prefix / 'lib'}:{ENV / 'lib'}",
        "PYTHONPATH": str(prefix / "lib" / site.name / "site-packages"),
        "ROS_DISTRO": "jazzy",
        "ROS_VERSION": "2",
        "ROS_LOG_DIR": str(MADE / "logs"),  # log is a file, of .ci/ros2
        "MAKEFLAGS": "-j",  # without it colcon waits for a machine that does nothing else
        "CMAKE_BUILD_PARALLEL_LEVEL": os.environ.get("CMAKE_BUILD_PARALLEL_LEVEL", str(os.cpu_count())),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "ROS_DOMAIN_ID": os.environ.get("ROS_DOMAIN_ID", DOMAIN),
    }


def run(command: Sequence[str | Path], cwd: Path = MADE, log: Path | None = None, prefix: Path = INSTALLED) -> str:
    """What a program printed. Raises RosError."""
    words = [str(word) for word in command]
    ended = subprocess.run(words, cwd=cwd, env=environment(prefix), text=True, capture_output=True, check=False)
    if log is not None:
        log.write_text(ended.stdout + ended.stderr)
    if ended.returncode:
        raise RosError(f"{Path(command[0]).name}: {(ended.stdout + ended.stderr)[-2000:]}")
    return ended.stdout


def inside(script: str, *words: str | Path, prefix: Path = INSTALLED) -> str:
    """A script of tests/proof/ros2/inside, by the Python that has rclpy."""
    return run([ENV / "bin" / "python", INSIDE / script, *words], prefix=prefix)
