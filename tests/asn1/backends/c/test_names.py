"""Names in C: two things never have the same one."""

import subprocess
from pathlib import Path

from asn1.backends.c import library
from asn1.backends.c.library import member
from tests.asn1.compiled import FLAGS, RUNTIME, schema_of

HOSTILE = """
A ::= SEQUENCE {
  a INTEGER OPTIONAL, has-a BOOLEAN, class NULL OPTIONAL, has-class NULL, count BOOLEAN,
  type SEQUENCE { a NULL, empty NULL }, decode SEQUENCE OF SEQUENCE { items NULL }, read CHOICE { has-a NULL, u NULL },
  names ENUMERATED { type, decode, u }, t A-type OPTIONAL, u A-write
}
A-type ::= SEQUENCE { type NULL }
A-write ::= INTEGER { type(3) } (0..7)
"""


def test_a_component_is_never_called_as_the_flag_of_another():
    words = ["a", "class", "has-a", "has-class", "has-has-a", "has-has-class", "has"]
    members = [member(word) for word in words]
    flags = [f"has_{name}" for name in members]
    assert len({*members, *flags}) == 2 * len(words)


def test_most_components_are_called_as_in_the_standard():
    assert [member(name) for name in ("a-b", "hasA", "class")] == ["a_b", "hasA", "class_"]


def test_types_tables_functions_and_numbers_never_meet(tmp_path: Path):
    made = library.generate(schema_of(HOSTILE, "A"), ["A"], tmp_path)
    sources = [path for path in made if path.suffix == ".c"]
    include = [f"-I{folder}" for folder in (tmp_path / "include", RUNTIME / "include", RUNTIME / "src")]
    done = subprocess.run(
        ["gcc", *FLAGS, "-fsyntax-only", *include, *sources], check=False, capture_output=True, text=True
    )
    assert done.stderr == ""
