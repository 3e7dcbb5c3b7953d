"""Output formats python and wheel: the built Python module captain_messages."""

from pathlib import Path

from asn1.backends import output
from asn1.backends.backend import VERSION, Job, OwnOption, Progress
from asn1.backends.c.form import RUNTIME, Sources
from asn1.backends.ros2.options import PROFILES

HERE = Path(__file__).parent


class CPython(output.FileBackend):
    """The module and its stubs. Its generated sources lie in .sources, its objects in .objects.

    is_wheel  build for the limited API (abi3), and write a wheel as well.
    """

    options: tuple[OwnOption, ...] = ("ros2",)

    def __init__(self, name: str, summary: str, next_step: str, *, is_wheel: bool) -> None:
        self.name = name
        self.summary = summary
        self.next_step = next_step
        self._is_wheel = is_wheel

    def steps(self, job: Job) -> int:
        from asn1.layout.layout import lay_out

        same = len([*(RUNTIME / "src").glob("*.c"), *HERE.glob("*.c")])
        modules = len(lay_out(job.schema, job.editions).nodes)
        # One step for generating, then one per source: fixed sources, code and tables per module, two lists of
        # messages.
        return 1 + same + 2 * modules + 2 + (_cdr_sources(job) if job.ros2.with_cdr else 0)

    def fill(self, job: Job, folder: Path, progress: Progress) -> None:
        from asn1.backends.cpython import stubs
        from asn1.layout.layout import lay_out

        stubs.write(lay_out(job.schema, job.editions), folder, job.ros2.with_cdr)

    def write(self, job: Job, folder: Path, progress: Progress) -> int:
        """Write the format, like Backend.write. Raises NotOursError, BuildError, RosError, OSError."""
        from asn1.backends.cpython import build, stubs

        changed = super().write(job, folder, progress)
        sources = folder / ".sources"
        changed += output.write(sources, lambda made: _sources(job, made, progress), Sources.name)
        module = build.build_python(sources, folder, is_limited=self._is_wheel, progress=progress)
        if self._is_wheel:
            build.write_wheel(folder, VERSION, module, (folder / stubs.NAME).read_text(encoding="utf-8"))
        return changed


PYTHON = CPython(
    "python",
    "Python module captain_messages, built, with typed stubs",
    "PYTHONPATH={folder} python3 -c 'import captain_messages as m; print(m.all())'",
    is_wheel=False,
)
WHEEL = CPython(
    "wheel",
    "the same as a wheel for pip, for CPython 3.10 and later",
    "pip install {folder}/*.whl",
    is_wheel=True,
)


def _sources(job: Job, folder: Path, progress: Progress) -> None:
    """Write the C sources, and the plan of the ROS 2 messages as C data."""
    from asn1.backends.ros2 import plan

    Sources().fill(job, folder, progress)
    (folder / "src" / "ros2_plan.c").write_text(plan.source(job.schema, job.editions), encoding="utf-8")


def _cdr_sources(job: Job) -> int:
    """Return the largest number of C files for ROS 2: the runtime, one per package, and their list."""
    from asn1.backends.ros2.cdr import library

    same = [*(library.RUNTIME / "src").glob("*.c"), *(HERE / "ros2").glob("*.c")]
    return len(same) + len(PROFILES) * len(job.messages) + 1
