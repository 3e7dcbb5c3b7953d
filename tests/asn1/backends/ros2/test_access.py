"""Functions in SI units, as they are generated for messages of CAM and DENM."""

from math import inf, nan
from types import SimpleNamespace

import pytest

from asn1.backends.ros2 import access, profile_etsi_its, profile_v2x_msgs
from asn1.model.text import load_schema

SCHEMA = load_schema()


def module(edition, profile=profile_etsi_its):
    [package] = profile.packages(SCHEMA, [SCHEMA.messages[edition]])
    made = {}
    exec(access.text(SCHEMA, package), made)
    return SimpleNamespace(**made)


SI = module("cam-1.4.1")


def test_a_speed_is_read_in_metres_a_second():
    assert SI.speed_value(SimpleNamespace(value=1389)) == 13.89


def test_what_is_unavailable_is_none_both_ways():
    message = SimpleNamespace(value=16383)
    assert SI.speed_value(message) is None
    SI.set_speed_value(message, 5.0)
    SI.set_speed_value(message, None)
    assert message.value == 16383


def test_a_value_is_set_to_the_nearest_number():
    message = SimpleNamespace(value=0)
    SI.set_latitude(message, 48.123456789)
    assert message.value == 481234568
    SI.set_speed_limit(message, 50 / 3.6)
    assert message.value == 50


def test_out_of_range_is_infinite_both_ways():
    message = SimpleNamespace(value=4094)
    assert SI.semi_axis_length(message) == inf
    SI.set_semi_axis_length(message, 1.0)
    SI.set_semi_axis_length(message, inf)
    assert message.value == 4094


@pytest.mark.parametrize("value", [1000.0, -0.1, 163.83, -inf, nan])
def test_a_value_beyond_the_range_is_told_with_the_range_of_values(value):
    with pytest.raises(ValueError, match=r"speed_value: .* is not from 0\.0 to 163\.82$"):
        SI.set_speed_value(SimpleNamespace(value=0), value)


def test_nothing_cannot_be_said_where_the_standard_has_no_number_for_it():
    with pytest.raises(ValueError, match="generation_delta_time: nothing is not from"):
        SI.set_generation_delta_time(SimpleNamespace(value=0), None)


def test_v2x_msgs_has_the_same_functions_on_its_own_fields():
    assert module("cam-1.4.1", profile_v2x_msgs).speed_value(SimpleNamespace(speed_value=1389)) == 13.89


def test_a_number_in_a_field_of_its_own_message_has_a_function_as_well():
    message = SimpleNamespace(max_waiting_time_minutes=0)
    module("evcsn-1.1.1").set_spot_availability_max_waiting_time_minutes(message, 90.0)
    assert message.max_waiting_time_minutes == 2
