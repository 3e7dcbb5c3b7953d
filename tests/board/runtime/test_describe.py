"""Descriptions: what a file says becomes a dataclass, or a message that names every mistake and its remedy."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from board.runtime.describe import Range, load, override, read
from board.runtime.errors import ConfigurationError
from tests.said import tells


@dataclass(frozen=True)
class Place:
    latitude: Annotated[float, Range(-90, 90)]
    longitude: Annotated[float, Range(-180, below=180)]


@dataclass(frozen=True)
class Row:
    name: str
    priority: Annotated[int, Range(0, 7)] = 3


@dataclass(frozen=True)
class Timing:
    window_s: Annotated[float, Range(above=0.0)] = 2.0
    hold_s: float = 0.5

    def __post_init__(self) -> None:
        if self.hold_s > self.window_s:
            raise ConfigurationError("hold_s is longer than window_s", "make it shorter")


@dataclass(frozen=True)
class Box:
    name: str
    profile: Literal["standard", "legacy"] = "standard"
    strict: bool = False
    rate: float = 0.0
    versions: tuple[int, ...] = (1,)
    place: Place | None = None
    timing: Timing = field(default_factory=Timing)
    rows: tuple[Row, ...] = ()
    ports: dict[str, Annotated[int, Range(1, 65535)]] = field(default_factory=dict)
    label: int | str = ""
    rest: dict[str, object] = field(default_factory=dict)
    class_: str = ""
    note: str | None = None


def mistakes(table: dict[str, object], kind: type = Box) -> list[str]:
    """What is wrong with a table, line by line, without the file's name."""
    with pytest.raises(ConfigurationError) as caught:
        read(kind, table, "box.toml")
    lines = caught.value.message.splitlines()
    assert all(line.startswith("box.toml: ") for line in lines)
    return [line.removeprefix("box.toml: ") for line in lines]


def test_a_full_description_becomes_a_frozen_dataclass():
    table = {
        "name": "a",
        "profile": "legacy",
        "strict": True,
        "rate": 10,
        "versions": [0, 1],
        "place": {"latitude": 48.5, "longitude": 11},
        "rows": [{"name": "x"}, {"name": "y", "priority": 0}],
        "ports": {"cam": 2001},
        "label": 7,
        "rest": {"anything": [1, {"goes": "here"}]},
        "class": "bus",
    }
    box = read(Box, table, "box.toml")
    assert box == Box(
        name="a",
        profile="legacy",
        strict=True,
        rate=10.0,
        versions=(0, 1),
        place=Place(48.5, 11.0),
        rows=(Row("x"), Row("y", 0)),
        ports={"cam": 2001},
        label=7,
        rest={"anything": [1, {"goes": "here"}]},
        class_="bus",
    )
    assert type(box.rate) is float


def test_keys_that_are_absent_keep_their_defaults():
    assert read(Box, {"name": "a"}, "box.toml") == Box("a")


def test_an_optional_key_without_a_default_may_be_absent():
    @dataclass(frozen=True)
    class Optional:
        port: int | None

    assert read(Optional, {}, "box.toml") == Optional(None)
    assert read(Optional, {"port": 5}, "box.toml") == Optional(5)


def test_a_section_without_a_default_may_be_absent_when_all_its_keys_may():
    @dataclass(frozen=True)
    class Outer:
        timing: Timing

    assert read(Outer, {}, "box.toml") == Outer(Timing())


def test_a_section_that_is_absent_names_the_keys_it_lacks():
    @dataclass(frozen=True)
    class Outer:
        place: Place

    assert mistakes({}, Outer) == [
        "place.latitude: is missing; give a number at least -90 and at most 90",
        "place.longitude: is missing; give a number at least -180 and below 180",
    ]


@pytest.mark.parametrize(
    ("table", "mistake"),
    [
        ({"nmae": "a", "name": "b"}, "nmae: is not a known key; did you mean name?"),
        ({"name": "a", "timing": {"windows_s": 1}}, "timing.windows_s: is not a known key; did you mean window_s?"),
        ({"name": "a", "place": {"latitude": 1, "longitude": 1, "q": 0}}, "place.q: is not a known key; known: latitude, longitude"),
        ({}, "name: is missing; give text in quotes"),
        ({"name": 5}, "name: 5 is an integer; give text in quotes"),
        ({"name": True}, "name: true is true or false; give text in quotes"),
        ({"name": "a", "strict": 1}, "strict: 1 is an integer; give true or false"),
        ({"name": "a", "strict": "true"}, 'strict: "true" is text in quotes; give true or false'),
        ({"name": "a", "rate": True}, "rate: true is true or false; give a number"),
        ({"name": "a", "rate": "fast"}, 'rate: "fast" is text in quotes; give a number'),
        ({"name": "a", "rate": float("nan")}, "rate: nan is not finite; give a number"),
        ({"name": "a", "rate": float("-inf")}, "rate: -inf is not finite; give a number"),
        ({"name": "a", "versions": 1}, "versions: 1 is an integer; give an array"),
        ({"name": "a", "versions": [1, True]}, "versions[1]: true is true or false; give an integer"),
        ({"name": "a", "versions": [1.0]}, "versions[0]: 1.0 is a number; give an integer"),
        ({"name": "a", "place": {"latitude": 1, "longitude": 1, "a key": 0}}, 'place."a key": is not a known key; known: latitude, longitude'),
        ({"name": "a", "place": 3}, "place: 3 is an integer; give a table"),
        ({"name": "a", "place": [{}]}, "place: [{}] is an array; write [place]"),
        ({"name": "a", "place": [{"x": True}, [1]]}, "place: [{x = true}, [1]] is an array; write [place]"),
        ({"name": "a", "place": [[[[[1]]]]]}, "place: [[[...]]] is an array; give a table"),
        ({"name": "a", "rows": {"name": "x"}}, 'rows: {name = "x"} is a table; write [[rows]]'),
        ({"name": "a", "place": []}, "place: [] is an array; give a table"),
        ({"name": "a", "versions": {"x": 1}}, "versions: {x = 1} is a table; give an array"),
        ({"name": "a", "ports": [{"cam": 1}]}, "ports: [{cam = 1}] is an array; give a table"),
        ({"name": "a", "rows": [{"name": "x"}, {}]}, "rows[1].name: is missing; give text in quotes"),
        ({"name": "a", "rows": [{"name": "x", "priority": 8}]}, "rows[0].priority: 8 is out of range; give at least 0 and at most 7"),
        ({"name": "a", "ports": {"cam": 0}}, "ports.cam: 0 is out of range; give at least 1 and at most 65535"),
        ({"name": "a", "ports": {"odd name": "x"}}, 'ports."odd name": "x" is text in quotes; give an integer'),
        ({"name": "a", "place": {"latitude": 90.1, "longitude": 0}}, "place.latitude: 90.1 is out of range; give at least -90 and at most 90"),
        ({"name": "a", "place": {"latitude": 0, "longitude": 180}}, "place.longitude: 180.0 is out of range; give at least -180 and below 180"),
        ({"name": "a", "timing": {"window_s": 0}}, "timing.window_s: 0.0 is out of range; give above 0"),
        ({"name": "a", "timing": {"hold_s": 3}}, "timing: hold_s is longer than window_s; make it shorter"),
        ({"name": "a", "profile": "legcy"}, 'profile: "legcy" is not a choice; did you mean "legacy"?'),
        ({"name": "a", "profile": 1}, 'profile: 1 is not a choice; known: "standard", "legacy"'),
        ({"name": "a", "label": 1.5}, "label: 1.5 is a number; give an integer or text in quotes"),
        ({"name": "a", "note": 1}, "note: 1 is an integer; give text in quotes"),
        ({"name": "a", "class_": "b"}, "class_: is not a known key; did you mean class?"),
    ],
)  # fmt: skip
def test_a_mistake_is_named_with_its_key_its_value_and_a_remedy(table: dict[str, object], mistake: str):
    assert mistakes(table) == [mistake]


def test_all_mistakes_of_a_file_come_at_once():
    table = {
        "nane": "a",
        "rate": "x",
        "rows": [{"name": 1}, {"name": "b", "priority": -1}],
        "timing": {"hold": 1},
    }
    assert [line.split(":")[0] for line in mistakes(table)] == [
        "nane",
        "name",
        "rate",
        "timing.hold",
        "rows[0].name",
        "rows[1].priority",
    ]


def test_a_choice_is_not_confused_by_python_thinking_true_equals_one():
    @dataclass(frozen=True)
    class Chosen:
        level: Literal[0, 1]

    assert read(Chosen, {"level": 1}, "box.toml") == Chosen(1)
    assert mistakes({"level": True}, Chosen) == ["level: true is not a choice; known: 0, 1"]


def test_integer_beyond_any_float_is_a_mistake_and_not_an_overflow():
    assert mistakes({"name": "a", "rate": 10**400})[0].endswith("... is not finite; give a number")
    (mistake,) = mistakes({"name": "a", "rate": 10**5000})
    assert tells(mistake, "rate: ", "not finite", "; ", "number")


def test_a_long_wrong_value_is_shortened():
    (line,) = mistakes({"name": ["x" * 1000]})
    assert len(line) < 120


def test_any_other_exception_of_a_dataclass_is_a_bug_and_passes_through():
    @dataclass(frozen=True)
    class Broken:
        def __post_init__(self) -> None:
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        read(Broken, {}, "box.toml")


toml_values = st.recursive(
    st.none().flatmap(lambda _: st.booleans() | st.integers() | st.floats() | st.text() | st.dates() | st.times()),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=4),
    max_leaves=12,
)


@given(table=st.dictionaries(st.sampled_from([*Box.__annotations__, "class", "x", ""]), toml_values))
@example(table={"name": {"\r\r": False}})
def test_any_table_is_read_or_explained(table: dict[str, object]):
    try:
        assert isinstance(read(Box, table, "box.toml"), Box)
    except ConfigurationError as error:
        assert all(line for line in error.message.splitlines())


# files


def written(folder: Path, octets: bytes) -> Path:
    path = folder / "box.toml"
    path.write_bytes(octets)
    return path


def test_a_file_is_loaded(tmp_path: Path):
    assert load(written(tmp_path, b'[station]\nname = "\xc3\xa4"\n')) == {"station": {"name": "ä"}}


def test_a_byte_order_mark_is_ignored(tmp_path: Path):
    assert load(written(tmp_path, b"\xef\xbb\xbfa = 1\n")) == {"a": 1}


@pytest.mark.parametrize(
    ("octets", "message"),
    [
        (b"a = 1\nb 2\n", "line 2, column 3: Expected '=' after a key in a key/value pair"),
        (b"a = [1,\n", "line 1, column 8: Invalid value"),
        (b'b = 1\na = "x', "line 2, column 7: Unterminated string"),
        (b"a = '''\nx\n\n\n", "line 2, column 2: Expected"),
        (b"[wifi]\n[wifi]\n", "line 2, column 6: Cannot declare wifi twice"),
        (b"[a]\nx.y = 1\n[a.x]\n", "line 3, column 5: Cannot declare a.x twice"),
        (b'["it\'s"]\n["it\'s"]', 'line 2, column 8: Cannot declare "it\'s" twice'),
        (b'["a.b"]\n["a.b"]', 'line 2, column 7: Cannot declare "a.b" twice'),
        (b"a = {b = 1}\na.c = 1", "line 2, column 8: Cannot mutate immutable namespace a"),
        (b"[a.b]\n[a]\nb.c = 1", "line 3, column 8: Cannot redefine namespace a.b"),
        (b"a = 1\na = 2\n", "line 2, column 6: Cannot overwrite a value"),
        (b"a = 1\nb = '\xff'\n", "line 2: octet 0xff is not UTF-8"),
        (b"a = " + b"[" * 100_000, "arrays or tables are nested too deep"),
        (b"a = " + b"9" * 5000, "line 1, column 1: a number has too many digits"),
        (b"#" * (1 << 20) + b"\n", "is longer than 1048576 octets"),
    ],
)
def test_a_file_that_is_not_toml_is_refused_with_its_line(tmp_path: Path, octets: bytes, message: str):
    path = written(tmp_path, octets)
    with pytest.raises(ConfigurationError) as caught:
        load(path)
    assert caught.value.message.startswith(f"{path}: {message}")


def test_a_file_that_cannot_be_read_is_named_with_the_reason(tmp_path: Path):
    for path, why in (
        (tmp_path / "absent.toml", "No such file or directory"),
        (tmp_path, "Is a directory"),
        (Path("nul\0.toml"), "embedded null byte"),
    ):
        with pytest.raises(ConfigurationError) as caught:
            load(path)
        assert caught.value.message == f"{path}: cannot be read: {why}"


@given(octets=st.binary(max_size=200))
def test_any_octets_are_toml_or_explained(tmp_path_factory: pytest.TempPathFactory, octets: bytes):
    path = written(tmp_path_factory.getbasetemp(), octets)
    try:
        assert isinstance(load(path), dict)
    except ConfigurationError as error:
        assert str(path) in error.message


# assignments of the command line


@pytest.mark.parametrize(
    ("assignment", "expected"),
    [
        ("station.name=b", {"station": {"name": "b", "x": 1}}),
        ("station.name = b c", {"station": {"name": "b c", "x": 1}}),
        ("station.name='5'", {"station": {"name": "5", "x": 1}}),
        ("station.name=", {"station": {"name": "", "x": 1}}),
        ("station.name=a=b", {"station": {"name": "a=b", "x": 1}}),
        ("station.name=12#34", {"station": {"name": "12#34", "x": 1}}),
        ("station.name=1,2", {"station": {"name": "1,2", "x": 1}}),
        ("station.name=1\nx=3", {"station": {"name": "1\nx=3", "x": 1}}),
        ("station.x=5", {"station": {"name": "a", "x": 5}}),
        ("station.x=true", {"station": {"name": "a", "x": True}}),
        ("station.x=[1, 2]", {"station": {"name": "a", "x": [1, 2]}}),
        ("station.x={a = 1}", {"station": {"name": "a", "x": {"a": 1}}}),
        ("station.x=127.0.0.1", {"station": {"name": "a", "x": "127.0.0.1"}}),
        ("station.x=02:00:00:00:00:0b", {"station": {"name": "a", "x": "02:00:00:00:00:0b"}}),
        ("new.deep.key=1", {"station": {"name": "a", "x": 1}, "new": {"deep": {"key": 1}}}),
        ('"odd name".x=1', {"station": {"name": "a", "x": 1}, "odd name": {"x": 1}}),
    ],
)
def test_an_assignment_sets_one_key(assignment: str, expected: dict[str, object]):
    table: dict[str, Any] = {"station": {"name": "a", "x": 1}}
    override(table, assignment)
    assert table == expected


def test_an_assignment_reaches_into_an_array_of_tables():
    table: dict[str, Any] = {"policy": [{"name": "a"}, {"name": "b"}], "versions": [1, 2]}
    override(table, "policy.1.name=c")
    override(table, "versions.0=0")
    assert table == {"policy": [{"name": "a"}, {"name": "c"}], "versions": [0, 2]}


@pytest.mark.parametrize(
    ("assignment", "message"),
    [
        ("station.name", "--set station.name: has no value"),
        ("=5", "--set : is not a key"),
        ("a..b=5", "--set a..b: is not a key"),
        ("a\nb=5", "--set a\nb: is not a key"),
        ("[a]\nb=5", "--set [a]\nb: is not a key"),
        ("name.x=5", '--set name.x: unknown key "x" in "a", text in quotes'),
        ("name.x.y=5", '--set name.x.y: unknown key "x" in "a", text in quotes'),
        ("rows.1.x=5", '--set rows.1.x: unknown key "1" in an array of 1'),
        ("rows.x=5", '--set rows.x: unknown key "x" in an array of 1'),
        ("rows.-1.x=5", '--set rows.-1.x: unknown key "-1" in an array of 1'),
        ("x=[1, 2", '--set x: "[1, 2" is not TOML'),
        ("x='a", '--set x: "\'a" is not TOML'),
        ("x=" + "[" * 100_000, '--set x: "' + "[" * 56 + "... is not TOML"),
    ],
)
def test_a_wrong_assignment_is_refused_and_named(assignment: str, message: str):
    with pytest.raises(ConfigurationError) as caught:
        override({"name": "a", "rows": [{}]}, assignment)
    assert caught.value.message == message


@given(assignment=st.text(max_size=40))
def test_any_assignment_is_taken_or_explained(assignment: str):
    table: dict[str, Any] = {"a": {"b": [1]}}
    try:
        override(table, assignment)
    except ConfigurationError as error:
        assert error.message.startswith("--set ")


@dataclass(frozen=True)
class Client:
    url: str
    name: str = ""
    certificate: str = ""
    key: str = ""
    port: int = 0

    def __post_init__(self) -> None:
        wrong = [f"{key}: has a space" for key in ("url", "name") if " " in getattr(self, key)]
        if bool(self.certificate) != bool(self.key):
            wrong.append("certificate and key are given together")
        if wrong:
            raise ConfigurationError("\n".join(wrong), "leave it out")


def client_mistakes(**table: object) -> list[str]:
    with pytest.raises(ConfigurationError) as caught:
        read(Client, table, "a.toml", "client")
    return str(caught.value).splitlines()


def test_keys_that_contradict_each_other_are_several_mistakes() -> None:
    of_url, of_name, of_key = client_mistakes(url="a b", name="c d", key="e")
    assert tells(of_url, "a.toml: client: url: ", "space; ")
    assert tells(of_name, "a.toml: client: name: ", "space; ")
    assert tells(of_key, "a.toml: client: certificate and key ", "; ")


def test_mistake_of_one_key_does_not_hide_that_of_another() -> None:
    of_colour, of_name, of_port, of_url = client_mistakes(url="a b", name=3, port="x", colour="red")
    assert tells(of_colour, "a.toml: client.colour: ", "known: url, name, certificate, key, port")
    assert tells(of_name, "a.toml: client.name: 3 ", "integer; ", "text")
    assert tells(of_port, 'a.toml: client.port: "x" ', "text", "; ", "integer")
    assert tells(of_url, "a.toml: client: url: ", "space; ")


def test_what_follows_from_a_mistake_is_not_told_beside_it() -> None:
    assert len(client_mistakes(url="a", certificate="b", key=3)) == 1
    assert len(client_mistakes(url=3, name="a b")) == 1  # without url there is no Client to look at
