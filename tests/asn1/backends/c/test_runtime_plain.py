"""The plain dialect of JSON over types with units and special values of every form."""

import json

import pytest

from asn1.backends.ros2 import access
from tests.asn1.compiled import Compiled, RefusedError, compiled, schema_of

# Names of special values: those that captain_si of ROS 2 has as well, and those of numbers that shall not be used.
SPECIAL = (*access.NO_VALUE, *access.BELOW, *access.BEYOND, "doNotUse", "valueNotUsed")
MODULE = (
    f"""
Special ::= INTEGER {{{", ".join(f"{name}({number})" for number, name in enumerate(SPECIAL))}}} (0..255)
"""
    + """
/** @unit 0.01 m/s */
Speed ::= INTEGER {standstill(0), oneCentimeterPerSec(1), outOfRange(16382), unavailable(16383)} (0..16383)
/** @unit 1e-7 degree */
Latitude ::= INTEGER {unavailable(900000001)} (-900000000..900000001)
/** @unit km/h */
Limit ::= INTEGER (1..255)
/** @unit 360/65535 degree */
Course ::= INTEGER (0..65535)
/** @unit 1/30000 1/m */
Curvature ::= INTEGER {unavailable(30001)} (-30000..30001)
/** @unit 100 kg */
Mass ::= INTEGER (1..1024)
/** @unit kPa */
Pressure ::= INTEGER (0..255)
/** @unit min */
Minutes ::= INTEGER (0..527040)
/** @unit ms */
Moment ::= INTEGER (0..4398046511103)
/** @unit 2 % */
Chance ::= INTEGER (0..50)
/** @unit person */
Persons ::= INTEGER {unavailable(127)} (0..127)
/** @unit 10^exponent Hz */
Mantissa ::= INTEGER (1..100)
/** @unit 0.01 s */
Delay ::= INTEGER (1..65535, ...)
/** @unit ms */
Free ::= INTEGER
/** @unit 1/1024 m */
Eighths ::= INTEGER (0..4294967295)
/** @unit 999999/7 km/h */
Vast ::= INTEGER (0..1000000000000)
/** @unit 0.1234567890123456789012 m */
Fine ::= INTEGER (0..255)
/** @unit 1/0 m */
Nothing ::= INTEGER (0..255)
/** @unit 0.05 m */
Height ::= INTEGER {outOfRange(126), unavailable(127)} (1..128)
Code ::= INTEGER {unavailable(0), fire(1)} (0..255)
Number ::= INTEGER (0..18446744073709551615)
Colour ::= ENUMERATED {red, green, ...}
Lights ::= BIT STRING {low(0), high(1), fog(3)} (SIZE (8))
Flags ::= BIT STRING {first(0), third(2)} (SIZE (1..14))
Controls ::= BIT STRING {brake(0)} (SIZE (3, ...))
Bits ::= BIT STRING (SIZE (8))
Set ::= SEQUENCE {
    speed Speed,
    /** @unit 0.1 m */
    own INTEGER (0..100),
    list SEQUENCE OF Speed OPTIONAL,
    choice CHOICE { mass Mass, code Code } OPTIONAL,
    ...
}
"""
)
NAMES = (
    "Speed", "Latitude", "Limit", "Course", "Curvature", "Mass", "Pressure", "Minutes", "Moment", "Chance", "Persons",
    "Mantissa", "Delay", "Free", "Height", "Eighths", "Vast", "Fine", "Nothing", "Code", "Number", "Colour", "Lights", "Flags", "Controls", "Bits", "Set", "Special",
)  # fmt: skip


@pytest.fixture(scope="module")
def types() -> Compiled:
    return compiled(schema_of(MODULE, *NAMES), NAMES)


@pytest.mark.parametrize(
    ("name", "exact", "plain"),
    [
        ("Speed", "0", "0"),
        ("Speed", "1", "0.01"),
        ("Speed", "1390", "13.9"),
        ("Speed", "16381", "163.81"),
        ("Speed", "16382", '"outOfRange"'),
        ("Speed", "16383", '"unavailable"'),
        ("Latitude", "-900000000", "-90"),
        ("Latitude", "-1", "-0.0000001"),
        ("Latitude", "487600001", "48.7600001"),
        ("Limit", "36", "10"),
        ("Limit", "50", "13.888888889"),
        ("Course", "65535", "360"),
        ("Course", "1", "0.005493248"),
        ("Curvature", "-1", "-0.000033333"),
        ("Curvature", "30000", "1"),
        ("Mass", "1024", "102400"),
        ("Pressure", "255", "255000"),
        ("Minutes", "527040", "31622400"),
        ("Moment", "4398046511103", "4398046511.103"),
        ("Chance", "50", "1"),
        ("Chance", "1", "0.02"),
        ("Persons", "3", "3"),
        ("Persons", "127", '"unavailable"'),
        ("Mantissa", "7", "7"),
        ("Delay", "65536", "655.36"),
        ("Free", "-9223372036854775808", "-9223372036854775.808"),
        ("Free", "9223372036854775807", "9223372036854775.807"),
        ("Eighths", "4294967295", "4194303.999023438"),
        ("Vast", "1000000000000", "1000000000000"),  # a step of this size and range is not converted
        ("Fine", "255", "255"),
        ("Nothing", "255", "255"),
        ("Height", "126", '"outOfRange"'),
        ("Height", "128", "6.4"),
        ("Code", "0", '"unavailable"'),
        ("Code", "1", "1"),
        ("Number", "18446744073709551615", "18446744073709551615"),
        ("Colour", '"green"', '"green"'),
        ("Colour", '"[3]"', '"[3]"'),
        ("Lights", '"D1"', '["low","high","fog","[7]"]'),
        ("Lights", '"00"', "[]"),
        ("Flags", '{"value":"A0","length":3}', '["first","third"]'),
        ("Controls", '{"value":"80","length":3}', '["brake"]'),
        ("Controls", '{"value":"0080","length":9}', '["[8]"]'),
        ("Bits", '"D1"', '"D1"'),
        (
            "Set",
            '{"speed":16383,"own":15,"list":[5,16382],"choice":{"mass":3},"[0]":"AA","[]":2}',
            '{"speed":"unavailable","own":1.5,"list":[0.05,"outOfRange"],"choice":{"mass":300},"[0]":"AA","[]":2}',
        ),
        ("Set", '{"speed":7,"own":0,"choice":{"code":0}}', '{"speed":0.07,"own":0,"choice":{"code":"unavailable"}}'),
    ],
)
def test_a_value_of_both_dialects_translates_both_ways(types: Compiled, name: str, exact: str, plain: str) -> None:
    assert types.to_plain(name, exact) == plain
    assert types.to_exact(name, plain) == exact


@pytest.mark.parametrize(
    ("name", "plain", "exact"),
    [
        ("Speed", "13.904", "1390"),
        ("Speed", "13.905", "1391"),
        ("Speed", "13.900000000000001", "1390"),
        ("Speed", "1.39e1", "1390"),
        ("Speed", "139e-1", "1390"),
        ("Speed", "-0.004", "0"),
        ("Speed", "163.814", "16381"),
        ("Speed", "0e99999999999999999999", "0"),
        ("Speed", "7e-99999999999999999999", "0"),
        ("Speed", f"13.9{'0' * 400}1", "1390"),
        ("Speed", f"0.{'0' * 400}139e402", "1390"),
        ("Latitude", "-48.76000005", "-487600001"),
        ("Limit", "13.9", "50"),
        ("Mass", "149.9", "1"),
        ("Persons", "1.5", "2"),
        ("Minutes", "90", "2"),
        ("Height", "6.3", "126"),  # a special value inside the range: the standard allows the number as well
        ("Code", "0", "0"),
        ("Lights", '["fog", "[1]"]', '"50"'),
    ],
)
def test_a_number_between_two_steps_is_rounded_to_the_nearest(
    types: Compiled, name: str, plain: str, exact: str
) -> None:
    assert types.to_exact(name, plain) == exact


@pytest.mark.parametrize(
    ("name", "plain", "why"),
    [
        ("Speed", "163.82", "163.82 is not in 0..163.81 m/s"),
        ("Speed", "163.83", "163.83 is not in 0..163.81 m/s"),
        ("Speed", "-0.01", "-0.01 is not in 0..163.81 m/s"),
        ("Speed", f"1{'9' * 400}", f"1{'9' * 39}... is not in 0..163.81 m/s"),
        ("Speed", "1e400", "1e400 is not in 0..163.81 m/s"),
        ("Latitude", "90.0000001", "90.0000001 is not in -90..90 degree"),
        ("Curvature", "1.0001", "1.0001 is not in -1..1 1/m"),
        ("Chance", "1.1", "1.1 is not in 0..1"),
        ("Free", "1e17", "1e17 is not in MIN..MAX s"),
        ("Code", "256", "256 is not in 0..255"),
        ("Speed", '"fast"', "fast is no special value of Speed; a number or outOfRange or unavailable is expected"),
        ("Speed", '"standstill"', "standstill is no special value of Speed; a number or outOfRange or unavailable is expected"),
        ("Limit", '"unavailable"', "unavailable is no special value of Limit; a number is expected"),
        ("Speed", f'"{"x" * 300}"', " is no special value of Speed; a number or outOfRange or unavailable is expected"),
        ("Speed", "NaN", "a number is expected at offset 0, found: NaN"),
        ("Speed", "null", "a number is expected at offset 0, found: null"),
        ("Speed", "[1]", "a number is expected at offset 0, found: [1]"),
        ("Lights", '"D1"', 'a list of the bits that are set is expected at offset 0, found: "D1"'),
        ("Lights", '["[8]"]', "[8] is no bit of Lights"),
        ("Lights", '["fogg"]', "fogg is no bit of Lights; did you mean fog?"),
        ("Lights", '["fog","[3]"]', "the bit is there twice"),
        ("Controls", '["[524288]"]', "[524288] is no bit of Controls"),
    ],
)  # fmt: skip
def test_an_invalid_value_is_refused_with_its_value_and_range(types: Compiled, name: str, plain: str, why: str) -> None:
    with pytest.raises(RefusedError) as caught:
        types.to_exact(name, plain)
    assert str(caught.value).partition(": ")[2] == why


def test_a_refusal_names_the_path(types: Compiled) -> None:
    with pytest.raises(RefusedError, match=r"^list\[1\]: 200 is not in 0\.\.163\.81 m/s$"):
        types.to_exact("Set", '{"speed":0,"own":0,"list":[1,200]}')
    with pytest.raises(RefusedError, match=r"^choice\.mass: 0 is not in 100\.\.102400 kg$"):
        types.to_exact("Set", '{"speed":0,"own":0,"choice":{"mass":0}}')


@pytest.mark.parametrize("name", SPECIAL)
def test_a_special_value_of_captain_si_is_one_of_json(types: Compiled, name: str) -> None:
    assert types.to_plain("Special", str(SPECIAL.index(name))) == f'"{name}"'


@pytest.mark.parametrize("name", ["Limit", "Course", "Chance", "Height", "Mantissa"])
def test_every_number_of_a_type_comes_back(types: Compiled, name: str) -> None:
    low, high = {"Course": (0, 65535), "Limit": (1, 255), "Chance": (0, 50), "Height": (1, 128), "Mantissa": (1, 100)}[
        name
    ]
    for number in range(low, high + 1, 1 if high < 1000 else 13):
        assert json.loads(types.to_exact(name, types.to_plain(name, str(number)))) == number
