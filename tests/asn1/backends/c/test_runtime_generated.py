"""The walkers against the generated code: two decoders that share no line, and JSON that gives the same octets back.

tests/asn1/backends/c/runtime/messages_main.c makes values from the tables, encodes them, changes bits, cuts octets off, and compares.
"""

import re
import subprocess
from pathlib import Path

import pytest

from asn1.backends.c import library
from tests.asn1.compiled import schema_of
from tests.asn1.walker import BUILD, RUNTIME, build_comparison

# Constructs of the standards, and others that X.680 allows.
MODULE = """
Constant ::= INTEGER (7)
Offset ::= INTEGER (-5..10)
Full ::= INTEGER (-9223372036854775808..9223372036854775807)
AtLeast ::= INTEGER (5..MAX)
AtMost ::= INTEGER (MIN..5)
Any ::= INTEGER
Growing ::= INTEGER (1..32, ...)
Holed ::= INTEGER (0..3 | 6..7)
Colour ::= ENUMERATED { red, green, blue }
Sparse ::= ENUMERATED { low(-3), high(70000), ..., late(5), later(9) }
Named ::= BIT STRING { first(0), third(2) } (SIZE(1..12))
NamedFixed ::= BIT STRING { first(0), third(2) } (SIZE(3))
Mask64 ::= BIT STRING (SIZE(64))
Long ::= BIT STRING (SIZE(70))
Bits ::= BIT STRING (SIZE(2..5, ...))
AnyBits ::= BIT STRING
Key ::= OCTET STRING (SIZE(3))
Octets ::= OCTET STRING (SIZE(1..4, ...))
AnyOctets ::= OCTET STRING
Letters ::= IA5String (FROM("A".."D")) (SIZE(0..7))
Digits ::= NumericString (SIZE(1..16))
One ::= VisibleString (FROM("x")) (SIZE(0..9))
Label ::= PrintableString (SIZE(1..4, ...))
AnyLabel ::= VisibleString
Text ::= UTF8String (SIZE(1..3))
Path ::= OBJECT IDENTIFIER
Arcs ::= RELATIVE-OID
Few ::= SEQUENCE (SIZE(0..3)) OF INTEGER (0..3)
Exactly ::= SEQUENCE (SIZE(2, ...)) OF Pair
Nothings ::= SEQUENCE OF NULL
Flags ::= SEQUENCE OF BOOLEAN
Lists ::= SEQUENCE (SIZE(1..MAX)) OF SEQUENCE (SIZE(0..2)) OF Octets
Some ::= SEQUENCE (SIZE(1..MAX, ...)) OF NULL
Pair ::= SEQUENCE { a INTEGER (0..3), b BOOLEAN }
Record ::= SEQUENCE { a INTEGER (0..3) OPTIONAL, b Pair, c Colour DEFAULT green, d OCTET STRING (SIZE(1)) }
Empty ::= SEQUENCE {}
Older ::= SEQUENCE { a BOOLEAN, ... }
Newer ::= SEQUENCE { a BOOLEAN, ..., b INTEGER (0..255), [[ c BOOLEAN, d Pair OPTIONAL, e Colour DEFAULT blue ]], f NULL, g AnyOctets }
Choose ::= CHOICE { x NULL, y Pair, ... }
Chosen ::= CHOICE { x NULL, y Pair, ..., z INTEGER (0..7), w OCTET STRING }
Only ::= CHOICE { x INTEGER (0..3) }
Nested ::= SEQUENCE { here INTEGER (0..1), more SEQUENCE (SIZE(0..2)) OF Nested, either CHOICE { self Nested, none NULL } OPTIONAL }
Large ::= SEQUENCE { first OCTET STRING (SIZE(64)), second OCTET STRING (SIZE(64)), third INTEGER (0..255) }
Holder ::= SEQUENCE { large Large OPTIONAL, either CHOICE { large Large, no NULL } }
Inner ::= Record (WITH COMPONENTS { ..., a PRESENT, c (red | blue) })
HOLDS ::= CLASS { &id INTEGER (0..255) UNIQUE, &Type } WITH SYNTAX { &Type IDENTIFIED BY &id }
Held HOLDS ::= { { Pair IDENTIFIED BY 1 } | { INTEGER (0..3) IDENTIFIED BY 2 } | { AnyOctets IDENTIFIED BY 3 }, ... }
Open ::= SEQUENCE { id HOLDS.&id ({Held}), value HOLDS.&Type ({Held}{@id}) }
"""
MESSAGES = tuple(re.findall(r"^(\w+) ::= (?!CLASS)", MODULE, re.MULTILINE))


@pytest.fixture(scope="module")
def sources(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Small types with what the standards use and what they might."""
    made = tmp_path_factory.mktemp("generated")
    library.generate(schema_of(MODULE, *MESSAGES), MESSAGES, made)
    return kept(made, BUILD / "constructs" / "sources")


@pytest.fixture(scope="module")
def constructs(sources: list[Path]) -> Path:
    return build_comparison("constructs", sources)


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


def test_examples_of_every_construct_encode_and_take_fields(sources: list[Path]) -> None:
    program = build_comparison("constructs", sources, "example")
    ran = subprocess.run([program, "300"], capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stdout[-2000:] + ran.stderr[-2000:]
    told = {name: (status, int(count)) for name, status, count in (line.split("|") for line in ran.stdout.splitlines())}
    assert set(told) == set(MESSAGES)
    assert not [name for name, (status, _) in told.items() if status != "ok"]
    containers = {"Few", "Exactly", "Record", "Newer", "Chosen", "Nested", "Large", "Holder", "Open"}
    assert not [name for name in containers if told[name][1] == 0]


@pytest.mark.usefixtures("constructs")
def test_every_name_that_a_program_could_clash_with_begins_with_captain() -> None:
    # Hidden symbols of a static library clash as well.
    objects = [BUILD / f"{source.stem}.o" for source in sorted(RUNTIME.glob("src/*.c"))]
    names = subprocess.run(["nm", "-g", "--defined-only", *objects], capture_output=True, text=True, check=True).stdout
    defined = {line.split()[-1] for line in names.splitlines() if len(line.split()) == 3}
    assert len(defined) > 100
    assert not [name for name in defined if not name.startswith("captain_")]
