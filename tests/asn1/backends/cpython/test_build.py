"""build_python: only what has changed is compiled."""

from pathlib import Path

import pytest

from asn1.backends.cpython import build


@pytest.fixture
def generated(tmp_path, monkeypatch):
    """A library of two sources, and an extension of one, instead of the real ones."""
    here = tmp_path / "cpython"
    for folder in (here, tmp_path / "made" / "src", tmp_path / "made" / "include"):
        folder.mkdir(parents=True)
    (here / "module.c").write_text(
        "int PyInit_captain_messages(void);\nint PyInit_captain_messages(void) { return 0; }\n"
    )
    (tmp_path / "made" / "include" / "one.h").write_text("#define ONE 1\n")
    (tmp_path / "made" / "src" / "one.c").write_text('#include "one.h"\nextern int one;\nint one = ONE;\n')
    (tmp_path / "made" / "src" / "two.c").write_text("extern int two;\nint two = 2;\n")
    monkeypatch.setattr(build, "HERE", here)
    return tmp_path / "made"


def compiled(generated: Path) -> list[str]:
    names: list[str] = []
    module = build.build_python(generated, generated.parent / "out", progress=names.append)
    assert module.exists()
    return sorted(names)


def test_nothing_is_compiled_twice(generated):
    assert compiled(generated) == ["module.c", "one.c", "two.c"]
    assert compiled(generated) == []


def test_what_includes_a_changed_header_is_compiled_again(generated):
    compiled(generated)
    (generated / "include" / "one.h").write_text("#define ONE 11\n")
    assert compiled(generated) == ["one.c"]


def test_objects_of_removed_sources_go(generated):
    compiled(generated)
    (generated / "src" / "two.c").unlink()
    assert compiled(generated) == []
    assert not list((generated.parent / "out" / ".objects").glob("src-two.*"))


def test_the_words_of_the_compiler_are_in_the_error(generated):
    (generated / "src" / "two.c").write_text("int two = nothing;\n")
    with pytest.raises(build.BuildError, match="nothing"):
        compiled(generated)


def test_an_object_of_an_interrupted_compilation_is_not_used(generated):
    compiled(generated)
    (generated.parent / "out" / ".objects" / "src-one.key").unlink()
    assert compiled(generated) == ["one.c"]
