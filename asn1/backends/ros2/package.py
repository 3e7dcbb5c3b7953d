"""Ament package of messages: writes it for colcon and as Debian source package."""

from collections.abc import Sequence
from pathlib import Path

from asn1.backends.ros2 import access, debian, msg
from asn1.backends.ros2.debian import MAINTAINER, Debian
from asn1.backends.ros2.model import RosPackage
from asn1.model.types import Schema

TEMPLATE = Path(__file__).parent / "template"


def write(schema: Schema, package: RosPackage, folder: Path, version: str, distro: str) -> None:
    """Write a package to a directory of its name below `folder`."""
    root = folder / package.name
    (root / "msg").mkdir(parents=True)
    for message in package.messages.values():
        (root / "msg" / f"{message.name}.msg").write_text(msg.text(schema, package, message), encoding="utf-8")
    for name, text in _files(package, version, distro).items():
        (root / name).write_text(text, encoding="utf-8")
    (root / "LICENSE").write_bytes((TEMPLATE / "LICENSE").read_bytes())
    made = Debian(
        package.name, f"ROS 2 messages: {package.name}", _about(package),
        ("ament_cmake", "rosidl_default_generators", *package.depends), ("rosidl_default_runtime", *package.depends),
        is_compiled=True,
    )  # fmt: skip
    debian.write(made, root, version, distro)


def write_access(schema: Schema, packages: list[RosPackage], folder: Path, version: str, distro: str) -> None:
    """Write the package captain_si, whose modules read and set values of these packages' messages in SI units."""
    root = folder / access.NAME
    (root / access.NAME).mkdir(parents=True)
    (root / access.NAME / "__init__.py").write_text('"""Values of messages in SI units."""\n', encoding="utf-8")
    for package in packages:
        path = root / access.NAME / f"{package.name}.py"
        path.write_text(access.text(schema, package), encoding="utf-8")
    summary = "ROS 2 messages: values in SI units"
    (root / "package.xml").write_text(_xml(access.NAME, version, summary, SI), encoding="utf-8")
    (root / "CMakeLists.txt").write_text(_template("si.cmake"), encoding="utf-8")
    (root / "LICENSE").write_bytes((TEMPLATE / "LICENSE").read_bytes())
    about = f"Python functions for {', '.join(package.name for package in packages)}"
    made = Debian(access.NAME, summary, about, ("ament_cmake", "ament_cmake_python"), (), is_compiled=False)
    debian.write(made, root, version, distro)


def _files(package: RosPackage, version: str, distro: str) -> dict[str, str]:
    return {
        "package.xml": _package_xml(package, version),
        "CMakeLists.txt": _cmake(package),
        "README.md": _readme(package, distro),
    }


def _template(name: str) -> str:
    return (TEMPLATE / name).read_text(encoding="utf-8")


def _about(package: RosPackage) -> str:
    return ", ".join(f"{one.pdu.name} of {one.standard}" for one in package.editions)


def _package_xml(package: RosPackage, version: str) -> str:
    lines = [
        "<buildtool_depend>ament_cmake</buildtool_depend>",
        "<buildtool_depend>rosidl_default_generators</buildtool_depend>",
        *(f"<depend>{one}</depend>" for one in package.depends),
        "<exec_depend>rosidl_default_runtime</exec_depend>",
        "<member_of_group>rosidl_interface_packages</member_of_group>",
    ]
    return _xml(package.name, version, f"ROS 2 messages: {_about(package)}", lines)


def _xml(package: str, version: str, about: str, lines: Sequence[str]) -> str:
    name, _, address = MAINTAINER.partition(" <")
    depends = "\n  ".join(lines)
    return f"""<?xml version="1.0"?>
<?xml-model href="http://download.ros.org/schema/package_format3.xsd" schematypens="http://www.w3.org/2001/XMLSchema"?>
<package format="3">
  <name>{package}</name>
  <version>{version}</version>
  <description>{about}</description>
  <maintainer email="{address.rstrip(">")}">{name}</maintainer>
  <license file="LICENSE">Apache-2.0</license>

  {depends}

  <export>
    <build_type>ament_cmake</build_type>
  </export>
</package>
"""


SI = ("<buildtool_depend>ament_cmake</buildtool_depend>", "<buildtool_depend>ament_cmake_python</buildtool_depend>")


def _cmake(package: RosPackage) -> str:
    files = "\n".join(f'  "msg/{name}.msg"' for name in package.messages)
    finds = "".join(f"find_package({one} REQUIRED)\n" for one in package.depends)
    depends = f"\n  DEPENDENCIES {' '.join(package.depends)}" if package.depends else ""
    exported = " ".join(("rosidl_default_runtime", *package.depends))
    return f"""cmake_minimum_required(VERSION 3.14)
project({package.name})

find_package(ament_cmake REQUIRED)
find_package(rosidl_default_generators REQUIRED)
{finds}
rosidl_generate_interfaces(${{PROJECT_NAME}}
{files}{depends}
)

ament_export_dependencies({exported})
ament_package()
"""


def _readme(package: RosPackage, distro: str) -> str:
    rows = "\n".join(
        f"| `{edition.name}` | {edition.standard} | `{package.name}/msg/{package.tops[edition.name]}` |"
        for edition in package.editions
    )
    return _template("README.md").format(
        name=package.name,
        rows=rows,
        profile=PROFILES[package.profile],
        deb=debian.name_of(package.name, distro),
        distro=distro,
    )


PROFILES = {
    "etsi_its": """\
Fields and constants have the names of etsi_its_messages, release 3.5.0. In a package of the same name, every type has
the same hash (RIHS01): nodes, bags and displays accept either. Install only one of both.""",
    "v2x_msgs": """\
Fields have the names of v2x_msgs of vehicleCAPTAIN. Every number is an int64. A CHOICE has a number, which is 0 if no
alternative is chosen.""",
}
