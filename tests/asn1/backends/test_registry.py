"""The table of output forms, and what the command line makes of it."""

import subprocess
import sys
from pathlib import Path

import pytest

from asn1.backends import output
from asn1.backends.backend import Backend, Job
from asn1.backends.registry import BACKENDS
from asn1.backends.ros2.options import Ros2Options
from asn1.model import text

ROOT = Path(__file__).resolve().parents[3]
SCHEMA = text.load_schema()
GENERATORS = ("c.library", "c.cpp", "cpython.build", "docs.pages", "asn.text", "ros2.package", "ros2.cdr")


@pytest.mark.parametrize(("name", "backend"), BACKENDS.items())
def test_a_form_is_in_the_table_under_its_own_name(name: str, backend: Backend):
    assert backend.name == name


@pytest.mark.parametrize("name", [name for name in BACKENDS if name not in ("python", "wheel")])
def test_a_form_that_is_written_has_its_name_in_the_manifest_and_no_more_steps_than_it_announced(
    name: str, tmp_path: Path
):
    backend, job, told = BACKENDS[name], Job(SCHEMA, ("vam-2.1.1",)), list[str]()
    changed = backend.write(job, tmp_path / "out", told.append)
    lines = (tmp_path / "out" / output.MANIFEST).read_text().splitlines()
    assert lines[0] == f"form: {name}"
    assert changed == len(lines) - 1 > 0
    assert 0 < len(told) <= backend.steps(job)
    assert backend.write(job, tmp_path / "out", told.append) == 0


def test_the_python_module_announces_a_step_for_each_source_and_more_of_them_for_ros_2():
    plain, ros2 = (
        BACKENDS["python"].steps(Job(SCHEMA, ("vam-2.1.1",), Ros2Options(with_cdr=both))) for both in (False, True)
    )
    assert ros2 > plain > len([*(ROOT / "asn1/backends/cpython").glob("*.c")])


def test_only_ros_2_packages_are_named_as_parts_of_a_folder(tmp_path: Path):
    (tmp_path / "one").mkdir()
    (tmp_path / "one" / "package.xml").touch()
    assert {name: backend.parts(tmp_path) for name, backend in BACKENDS.items() if backend.parts(tmp_path)} == {
        "ros2": {"one"}
    }


def test_the_table_loads_no_generator():
    script = (
        f"import sys, asn1.backends.registry; print(*(n for n in {GENERATORS} if 'asn1.backends.' + n in sys.modules))"
    )
    ended = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True)
    assert ended.stdout.split() == []


@pytest.mark.parametrize("name", GENERATORS)
def test_a_generator_of_that_test_is_a_module(name: str):
    path = ROOT / "asn1" / "backends" / name.replace(".", "/")
    assert path.is_dir() or path.with_suffix(".py").is_file()
