"""Names in C: two things never have the same one."""

from asn1.c import member


def test_a_component_is_never_called_as_the_flag_of_another():
    words = ["a", "class", "has-a", "has-class", "has-has-a", "has-has-class", "has"]
    members = [member(word) for word in words]
    flags = [f"has_{name}" for name in members]
    assert len({*members, *flags}) == 2 * len(words)


def test_most_components_are_called_as_in_the_standard():
    assert [member(name) for name in ("a-b", "hasA", "class")] == ["a_b", "hasA", "class_"]
