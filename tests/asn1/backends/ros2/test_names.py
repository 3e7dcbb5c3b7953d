"""The naming rules, each by names of the standards and what etsi_its_messages 3.5.0 makes of them."""

import pytest

from asn1.backends.ros2.model import RosError
from asn1.backends.ros2.names import constant_name, field_name, file_name, integer_type, type_name


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("CAM", "CAM"),
        ("Scale-B12", "ScaleB12"),
        ("NodeXY-20b", "NodeXY20b"),
        ("InternationalSign-speedLimits", "InternationalSignspeedLimits"),
        ("DDD-IO-LIST", "DDDIOLIST"),
        ("int1", "Int1"),
        ("3dPosition", "A3dPosition"),
    ],
)
def test_a_message_is_called_without_dashes_and_with_a_capital(name, expected):
    assert type_name(name) == expected


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("generationDeltaTime", "generation_delta_time"),
        ("protectedCommunicationZonesRSU", "protected_communication_zones_rsu"),
        ("stationID", "station_id"),
        ("destRSCode", "dest_rs_code"),
        ("its-Rrid", "its_rrid"),
        ("node-XY1", "node_xy1"),
        ("cenDsrcTollingZone", "cen_dsrc_tolling_zone"),
        ("class", "cls"),
        ("long", "lon"),
        ("default", "default_field"),
        ("from", "from_field"),
        ("euVehicleCategoryL", "eu_vehicle_category_l"),
    ],
)
def test_a_field_is_called_in_lower_case_with_an_underscore_before_each_word(name, expected):
    assert field_name(name) == expected


@pytest.mark.parametrize(
    ("name", "expected"),
    [("StationID", "station_id"), ("StationId", "station_id"), ("NodeXY20b", "node_xy20b"), ("DDDIOLIST", "dddiolist")],
)
def test_files_of_a_message_are_called_as_rosidl_calls_them(name, expected):
    assert file_name(name) == expected


def test_a_constant_has_the_name_of_its_field_in_front_and_is_made_a_name_once_more():
    assert constant_name("alt-000-01") == "ALT_000_01"
    assert constant_name("MIN", "layoutId") == "LAYOUT_ID_MIN"
    assert constant_name("value", "co2") == "CO2_VALUE"


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [
        (0, 255, "uint8"),
        (0, 256, "uint16"),
        (1, 65535, "uint16"),
        (0, 2**42 - 1, "uint64"),
        (-1, 127, "int8"),
        (-1, 128, "int16"),
        (-900000000, 900000001, "int32"),
        (None, 5, "int64"),
        (0, None, "int64"),
    ],
)
def test_a_number_has_the_smallest_type_that_holds_its_range(low, high, expected):
    assert integer_type(low, high) == expected


def test_a_range_that_no_number_of_ros_2_holds_is_told():
    with pytest.raises(RosError, match=r"-1\.\.18446744073709551615"):
        integer_type(-1, 2**64 - 1)
