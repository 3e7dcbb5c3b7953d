"""Output form ros2: message packages."""

from pathlib import Path

from asn1.backends.backend import VERSION, Job, OwnOption, Progress
from asn1.backends.output import FileBackend


class RosPackages(FileBackend):
    """One package per edition, and captain_si for values in SI units."""

    name = "ros2"
    summary = "ROS 2 message packages, for colcon and as Debian source packages"
    next_step = "colcon build --base-paths {folder}"
    options: tuple[OwnOption, ...] = ("profile", "distro")

    def default_folder(self) -> str:
        return "build/ros2-packages"  # build/ros2 contains the ROS of the tests

    def steps(self, job: Job) -> int:
        return len(job.messages)

    def parts(self, folder: Path) -> set[str]:
        """Return the names of the packages in the folder."""
        return {path.parent.name for path in folder.glob("*/package.xml")}

    def fill(self, job: Job, folder: Path, progress: Progress) -> None:
        """Write the format. Raises RosError for a message that ROS 2 cannot represent."""
        from asn1.backends.ros2 import package, profiles

        packages = profiles.packages(job.schema, job.editions, job.ros2.profile)
        for one in packages:
            progress(one.name)
            package.write(job.schema, one, folder, VERSION, job.ros2.distro)
        package.write_access(job.schema, packages, folder, VERSION, job.ros2.distro)
