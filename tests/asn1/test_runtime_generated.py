"""The walkers against the generated code: two decoders that share no line, and JSON that gives the same octets back.

tests/asn1/runtime/messages_main.c makes values from the tables, encodes them, changes bits, cuts octets off, and compares.
"""

import subprocess
from pathlib import Path

import pytest

from asn1 import c
from tests.asn1.compiled import schema_of
from tests.asn1.test_c_codec import MODULE, NAMES
from tests.asn1.walker import BUILD, RUNTIME, build_comparison

MESSAGES = tuple(name for name in NAMES if name != "HOLDS")


@pytest.fixture(scope="module")
def constructs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Small types with what the standards use and what they might."""
    made = tmp_path_factory.mktemp("generated")
    c.generate(schema_of(MODULE, *MESSAGES), MESSAGES, made)
    return build_comparison("constructs", kept(made, BUILD / "constructs" / "sources"))


def kept(made: Path, folder: Path) -> list[Path]:
    """The files of `made` in another folder, touched only where they differ from what is there."""
    files = [path.relative_to(made) for path in sorted(made.rglob("*.[ch]"))]
    for file in files:
        target = folder / file
        if not target.exists() or target.read_bytes() != (made / file).read_bytes():
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes((made / file).read_bytes())
    return [folder / file for file in files]


@pytest.mark.parametrize("seed", [1, 2])
def test_both_decoders_and_json_agree(constructs: Path, seed: int) -> None:
    ran = subprocess.run([constructs, "150", str(seed)], capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stdout[-2000:] + ran.stderr[-2000:]
    told = {line.split()[0]: int(line.split()[2]) for line in ran.stdout.splitlines()}
    assert set(told) == set(MESSAGES)
    assert not [name for name, decoded in told.items() if decoded == 0]


@pytest.mark.usefixtures("constructs")
def test_every_name_that_a_program_could_clash_with_begins_with_captain() -> None:
    # Hidden symbols of a static library clash as well.
    objects = [BUILD / f"{source.stem}.o" for source in sorted(RUNTIME.glob("src/*.c"))]
    names = subprocess.run(["nm", "-g", "--defined-only", *objects], capture_output=True, text=True, check=True).stdout
    defined = {line.split()[-1] for line in names.splitlines() if len(line.split()) == 3}
    assert len(defined) > 100
    assert not [name for name in defined if not name.startswith("captain_")]
