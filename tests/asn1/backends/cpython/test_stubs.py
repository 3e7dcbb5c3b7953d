"""captain_messages.pyi: what type checkers know."""

import ast

from asn1.backends.cpython import stubs
from asn1.layout.layout import lay_out
from asn1.model.text import load_schema
from tests.asn1.compiled import schema_of


def classes(text):
    return {node.name: node for node in ast.parse(text).body if isinstance(node, ast.ClassDef)}


def of(*names):
    schema = load_schema()
    return stubs.text(lay_out(schema, [schema.messages[name] for name in names]))


def test_every_record_is_a_typed_dict_and_a_view():
    made = classes(of("cam-1.4.1"))
    for name in ("r1_cam_CAM", "r1_cdd_ItsPduHeader", "r1_cdd_ReferencePosition"):
        components = [line.target.id for line in made[name].body]
        assert components == [method.name for method in made[f"{name}_View"].body]
    assert [line.target.id for line in made["r1_cam_CAM"].body] == ["header", "cam"]


def test_what_may_be_absent_is_not_required_and_none_in_a_view():
    text = of("cam-1.4.1")
    assert "    lowFrequencyContainer: NotRequired[r1_cam_LowFrequencyContainer]" in text
    assert "def lowFrequencyContainer(self) -> ChoiceView[r1_cam_LowFrequencyContainer," in text
    assert "r1_cam_BasicVehicleContainerLowFrequency_View | bytes] | None: ..." in text


def test_names_that_python_cannot_say():
    text = of("spatem-2.1.1")
    ast.parse(text)
    assert '    "state-time-speed": ' in text
    assert "def state_time_speed(self)" in text
    assert stubs.attribute("class") == "class_"


def test_a_message_is_found_by_name_and_by_type():
    text = of("cam-1.4.1", "cam-2.3.1")
    assert 'def find(name: Literal["cam-2.3.1"], /) -> Message[r2_cam231_CAM, r2_cam231_CAM_View]: ...' in text
    assert text.count('def find(name: Literal["cam"], /)') == 1


def test_types_inside_themselves_end_where_they_begin_again():
    names = ("Deep", "Nests", "Tree")
    schema = schema_of(
        "Deep ::= CHOICE { leaf BOOLEAN, more Deep } Nests ::= SEQUENCE OF Nests Tree ::= SEQUENCE OF Deep", *names
    )
    text = stubs.text(lay_out(schema, list(schema.messages.values())))
    ast.parse(text)
    assert 'm_Deep: TypeAlias = tuple[Literal["leaf"], bool] | tuple[Literal["more"], m_Deep]' in text
    assert 'find(name: Literal["deep"], /) -> Message[m_Deep, ChoiceView[m_Deep, bool | Any]]: ...' in text
    assert 'find(name: Literal["nests"], /) -> Message[list[Any], ListView[Any, Any]]: ...' in text
    assert "Message[list[m_Deep], ListView[m_Deep, ChoiceView[m_Deep, bool | Any]]]: ..." in text


def test_the_stub_of_all_messages_is_python_and_the_same_twice():
    names = load_schema().messages
    text = of(*names)
    ast.parse(text)
    assert of(*names) == text
