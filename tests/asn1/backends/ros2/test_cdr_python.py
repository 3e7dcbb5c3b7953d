"""to_cdr and from_cdr of the Python module: what is kept beside a ROS message, and what is said of a wrong one."""

import importlib.util
import sys
from types import ModuleType

import pytest

from asn1.backends.backend import Job
from asn1.backends.registry import BACKENDS
from asn1.backends.ros2.options import Ros2Options
from tests.asn1.compiled import BUILD, schema_of

SCHEMA = schema_of(
    """
    Report ::= SEQUENCE {small Small, wide Wide, kind Kind, name Name, place Place, ...}
    Small ::= INTEGER (0..200)
    Wide ::= INTEGER (-5..70000)
    Kind ::= ENUMERATED {red, green, ...}
    Name ::= UTF8String
    Place ::= CHOICE {near Small, regional RegionalExtension}
    RegionalExtension ::= SEQUENCE {regionId Small}
    """,
    "Report",
)  # fmt: skip
VALUE = {"small": 7, "wide": 70000, "kind": "green", "name": "né", "place": ("near", 5)}
CDR = bytes.fromhex("00010000 07 000000 70110100 01 000000 04000000 6ec3a900 00 05".replace(" ", ""))
NAME = "captain_messages"
PADDING = (5, 6, 7, 13, 14, 15)  # in CDR: behind small and kind


@pytest.fixture(scope="module")
def codec() -> ModuleType:
    """A module of its own beside the one of build/codec; built once for the same sources."""
    folder = BUILD / "ros2-python"
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("CFLAGS", "-O0")
        BACKENDS["python"].write(Job(SCHEMA, ("Report",), Ros2Options(with_cdr=True)), folder, lambda _: None)
    [path] = folder.glob(f"{NAME}.*.so")
    with pytest.MonkeyPatch.context() as patch:
        # An extension that is loaded puts itself there, where the station's own tests find theirs.
        patch.delitem(sys.modules, NAME, raising=False)
        spec = importlib.util.spec_from_file_location(NAME, path)
        assert spec is not None
        assert spec.loader is not None
        made = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(made)
        sys.modules.pop(NAME, None)
    return made


@pytest.fixture
def report(codec):
    return codec.find("Report")


def with_padding(cdr: bytes, octet: int = 0xA5) -> bytes:
    """As Fast CDR leaves it: whatever the memory held."""
    return bytes(octet if at in PADDING else one for at, one in enumerate(cdr))


def test_a_message_is_what_a_raw_publisher_takes_and_comes_back(report):
    octets = report.encode(VALUE)
    assert report.to_cdr(octets) == (CDR, ())
    assert report.from_cdr(CDR) == octets
    assert report.from_cdr(with_padding(CDR)) == octets


@pytest.mark.parametrize("kind", [bytes, bytearray, memoryview])
def test_octets_come_in_any_buffer(report, kind):
    octets = report.encode(VALUE)
    assert report.to_cdr(kind(octets))[0] == CDR
    assert report.from_cdr(kind(CDR), original=kind(octets)) == octets


def test_the_type_of_each_profile_has_a_name(codec, report):
    assert report.ros2_type() == report.ros2_type("etsi_its") == "captain_report_msgs/msg/Report"
    assert report.ros2_type(profile="v2x_msgs") == "captain_v2x_report_msgs/msg/Report"
    assert report.from_cdr(report.to_cdr(report.encode(VALUE), "v2x_msgs")[0], "v2x_msgs") == report.encode(VALUE)
    for call in (report.ros2_type, lambda name: report.to_cdr(b"", name), lambda name: report.from_cdr(b"", name)):
        with pytest.raises(LookupError, match="no ROS 2 message for Report in the profile other"):
            call("other")


NEWER = {
    "an addition": ({**VALUE, "[0]": b"\xc0\xff\xee"}, "[0]", b"\xc0\xff\xee"),
    "an item": ({**VALUE, "kind": 3}, "kind", b""),
    "a regional alternative": ({**VALUE, "place": ("regional", {"regionId": 4})}, "place", None),
}


@pytest.mark.parametrize("case", NEWER)
def test_what_has_no_field_is_kept_beside_and_attached_again(report, case):
    value, path, left = NEWER[case]
    octets = report.encode(value)
    cdr, [left_out] = report.to_cdr(octets)
    assert left_out.path == path
    assert left is None or left_out.octets == left
    assert report.from_cdr(cdr, original=octets) == octets
    assert report.from_cdr(with_padding(cdr), original=octets) == octets


def test_of_a_message_that_was_changed_nothing_is_attached(report):
    octets = report.encode({**VALUE, "[0]": b"\xc0\xff\xee"})
    cdr, _ = report.to_cdr(octets)
    changed = cdr[:4] + b"\x08" + cdr[5:]
    assert report.from_cdr(changed, original=octets) == report.encode({**VALUE, "small": 8})


def test_what_stands_for_something_left_out_is_refused_in_a_message_that_was_changed(codec, report):
    octets = report.encode({**VALUE, "kind": 3})
    cdr, _ = report.to_cdr(octets)
    with pytest.raises(codec.CdrError, match=r"kind\.value: octet 12: .*255 is no item of Kind"):
        report.from_cdr(cdr[:4] + b"\x08" + cdr[5:], original=octets)


def test_an_error_names_field_octet_value_and_range(codec, report):
    with pytest.raises(codec.CdrError) as caught:
        report.from_cdr(CDR.replace(b"\x70\x11\x01", b"\x71\x11\x01"))
    assert (caught.value.path, caught.value.octet) == ("wide.value", 8)
    assert caught.value.reason == "out of range: 70001 is not in -5..70000"
    assert str(caught.value) == "wide.value: octet 8: out of range: 70001 is not in -5..70000"


@pytest.mark.parametrize("end", range(len(CDR)))
def test_cdr_that_ends_early_is_refused_with_or_without_its_original(codec, report, end):
    for original in (None, report.encode(VALUE)):
        with pytest.raises(codec.CdrError, match="truncated"):
            report.from_cdr(CDR[:end], original=original)


def test_octets_that_are_no_message_are_a_decode_error_either_way(codec, report):
    with pytest.raises(codec.DecodeError):
        report.to_cdr(b"")
    with pytest.raises(codec.DecodeError):
        report.from_cdr(CDR, original=b"")


@pytest.mark.parametrize(
    ("arguments", "names"), [((), {}), ((1,), {}), ((b"", "a", None, None), {}), ((b"",), {"what": 1}), ((b"", 5), {})]
)
def test_arguments_that_make_no_sense_are_a_type_error(report, arguments, names):
    for call in (report.to_cdr, report.from_cdr):
        with pytest.raises(TypeError):
            call(*arguments, **names)
