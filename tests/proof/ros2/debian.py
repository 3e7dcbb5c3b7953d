"""Debian package of messages: built, unpacked, used by rclpy.

Debian has no packages of ROS here. So the ROS of the bench is mounted at /opt/ros/jazzy during the build, in a mount
namespace of its own. Build-Depends are ignored, and nothing is installed on this machine.
"""

import shutil
import subprocess
from pathlib import Path

from asn1.backends.backend import Job
from asn1.backends.registry import BACKENDS
from asn1.backends.ros2 import access, profiles
from asn1.backends.ros2.debian import name_of
from asn1.backends.ros2.model import RosPackage
from tests.proof.ros2 import ros
from tests.proof.ros2.packages import SCHEMA
from tests.proof.ros2.rows import Row

EDITION = "rawrx-1"  # of seven types: how it is built does not depend on how many there are
DISTRO = "jazzy"
PREFIX = f"opt/ros/{DISTRO}"
FOLDER = ros.MADE / "debian"

BUILD = """\
mount -t tmpfs none /opt
mkdir -p "/$PREFIX"
for one in "$ENV"/*; do
    if [ -d "$one" ]; then mkdir "/$PREFIX/${one##*/}" && mount --bind "$one" "/$PREFIX/${one##*/}"
    else cp "$one" "/$PREFIX"
    fi
done
cat >"/$PREFIX/setup.sh" <<END
export PATH=/$PREFIX/bin:\\$PATH VIRTUAL_ENV=/$PREFIX AMENT_PREFIX_PATH=/$PREFIX LD_LIBRARY_PATH=/$PREFIX/lib
END
exec dpkg-buildpackage -us -uc -b -d
"""


def build(_: list[RosPackage]) -> list[Row]:
    """Rows: the packages that are built, what the binary one holds, and that rclpy takes it; functions in SI units."""
    [package] = profiles.packages(SCHEMA, [SCHEMA.messages[EDITION]])
    shutil.rmtree(FOLDER, ignore_errors=True)
    BACKENDS["ros2"].write(Job(SCHEMA, (EDITION,)), FOLDER, lambda _: None)
    binary, functions = _built(package.name), _built(access.NAME)
    paths = {line.split()[5] for line in _run(["dpkg-deb", "-c", binary.name], FOLDER).splitlines()}
    troubles = {"missing": sorted(_wanted(package) - paths), "elsewhere": sorted(filter(_is_elsewhere, paths))}
    for one in (binary, functions):
        _run(["dpkg-deb", "-x", one.name, "root"], FOLDER)
    root = FOLDER / "root" / PREFIX
    [modules] = root.glob(f"lib/python3.*/site-packages/{access.NAME}")
    return [
        Row(f"{package.name} as Debian package", f"{binary.name}: {len(paths)} paths, {binary.stat().st_size // 1000} kB"),
        Row("what it holds", "libraries, headers, Python, .msg, .idl, package.xml, mark of the ament index",
            "; ".join(f"{word}: {', '.join(some)}" for word, some in troubles.items() if some)),
        Row("what it needs", _run(["dpkg-deb", "-f", binary.name, "Depends"], FOLDER).strip()),
        Row("unpacked and used by rclpy", ros.inside("use.py", package.name, prefix=root).strip()),
        Row(f"{access.NAME} as Debian package", f"{functions.name}: {', '.join(sorted(one.name for one in modules.glob('*.py')))}"),
    ]  # fmt: skip


def _built(package: str) -> Path:
    """The binary package, and beside it the source package."""
    _run(["dpkg-source", "-b", package], FOLDER)
    _run(["unshare", "--map-root-user", "--mount", "sh", "-ec", BUILD], FOLDER / package, ENV=ros.ENV, PREFIX=PREFIX)
    [binary] = FOLDER.glob(f"{name_of(package, DISTRO)}_*.deb")
    return binary


def _is_elsewhere(path: str) -> bool:
    return not path.startswith((f"./{PREFIX}/", "./usr/share/doc/")) and path[-1] != "/"


def _wanted(package: RosPackage) -> set[str]:
    """What users of C, C++, Python and of the ament index look for."""
    [site] = (ros.ENV / "lib").glob("python3.*")
    root, share = f"./{PREFIX}", f"./{PREFIX}/share/{package.name}"
    libraries = (
        "rosidl_generator_c",
        "rosidl_typesupport_c",
        "rosidl_typesupport_cpp",
        "rosidl_typesupport_fastrtps_cpp",
    )
    return {
        f"{share}/package.xml", f"{share}/cmake/{package.name}Config.cmake",
        f"{root}/share/ament_index/resource_index/packages/{package.name}",
        f"{root}/lib/{site.name}/site-packages/{package.name}/msg/__init__.py",
        *(f"{root}/lib/lib{package.name}__{one}.so" for one in libraries),
        *(f"{share}/msg/{one}.{ending}" for one in package.messages for ending in ("msg", "idl")),
    }  # fmt: skip


def _run(command: list[str], folder: Path, **variables: Path | str) -> str:
    """What it prints. Raises RosError."""
    environment = {
        "PATH": "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin", "LANG": "C.UTF-8",
        "DEB_BUILD_OPTIONS": "noopt nodbg parallel=2", **{name: str(value) for name, value in variables.items()},
    }  # fmt: skip
    ended = subprocess.run(command, cwd=folder, env=environment, text=True, capture_output=True, check=False)
    if ended.returncode:
        raise ros.RosError(f"{command[0]}: {(ended.stdout + ended.stderr)[-2000:]}")
    return ended.stdout
