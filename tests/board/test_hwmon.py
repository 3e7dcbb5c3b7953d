"""Rails, temperatures and fan as files of the kernel: a tree of directories like that of /sys."""

import pytest

from board import hwmon
from board.description import FanDescription, RailDescription, TemperatureDescription
from board.runtime.errors import InterfaceError
from tests.said import tells


@pytest.fixture
def device(tmp_path):
    """Makes a hwmon device: device("hwmon0", name="ina226", in1_input=12000)."""

    def device(folder, at="", **files):
        directory = tmp_path / "class/hwmon" / folder
        directory.mkdir(parents=True)
        if at:
            (tmp_path / "devices" / at).mkdir(parents=True)
            (directory / "device").symlink_to(tmp_path / "devices" / at)
        for name, value in files.items():
            (directory / name).write_text(f"{value}\n")
        return directory

    return device


def test_a_rail_is_millivolts_and_milliamperes(tmp_path, device):
    device("hwmon0", name="cpu_thermal", temp1_input=48312)
    device("hwmon1", name="ina226", in1_input=11980, curr1_input=-2500)
    rail = RailDescription("ina226", hwmon="ina226")
    assert hwmon.rail(tmp_path, rail) == pytest.approx((11.98, -2.5, -29.95))


def test_a_channel_of_several_has_its_own_files(tmp_path, device):
    device("hwmon0", name="ina3221", in1_input=1, in2_input=5016, curr1_input=2, curr2_input=800)
    rail = RailDescription("ina3221", hwmon="ina3221", channel=2)
    assert hwmon.rail(tmp_path, rail)[:2] == pytest.approx((5.016, 0.8))


def test_of_several_devices_of_one_name_the_address_decides(tmp_path, device):
    device("hwmon2", at="1-0040", name="ina226", in1_input=12000, curr1_input=0)
    device("hwmon10", at="1-0041", name="ina226", in1_input=3300, curr1_input=0)
    volts = [hwmon.rail(tmp_path, RailDescription("ina226", hwmon="ina226", address=at)).volts for at in (0x40, 0x41)]
    assert volts == [12.0, 3.3]


def test_a_temperature_is_found_by_device_or_by_zone(tmp_path, device):
    device("hwmon0", name="tmp102", temp1_input=-1500)
    zone = tmp_path / "class/thermal/thermal_zone0"
    zone.mkdir(parents=True)
    (zone / "type").write_text("cpu-thermal\n")
    (zone / "temp").write_text("48312\n")
    assert hwmon.temperature(tmp_path, TemperatureDescription("hwmon", source="tmp102")) == -1.5
    assert hwmon.temperature(tmp_path, TemperatureDescription("thermal", source="cpu-thermal")) == 48.312


@pytest.mark.parametrize(("files", "found"), [
    ({"fan1_input": 4200}, {"rpm": 4200}),
    ({"pwm1": 51}, {"percent": 20.0}),
    ({"fan1_input": 0, "pwm1": 255}, {"rpm": 0, "percent": 100.0}),
])  # fmt: skip
def test_a_fan_tells_what_it_has(tmp_path, device, files, found):
    device("hwmon0", name="pwmfan", **files)
    assert hwmon.fan(tmp_path, FanDescription("pwmfan")) == found


def test_a_fan_is_taken_from_the_kernel_and_driven(tmp_path, device):
    directory = device("hwmon0", name="emc2305", pwm2=255, pwm2_enable=2)
    hwmon.set_fan(tmp_path, FanDescription("emc2305", channel=2), 40.0)
    assert ((directory / "pwm2").read_text(), (directory / "pwm2_enable").read_text()) == ("102", "1")


def test_device_of_hwmon_that_is_absent_is_refused_with_the_known_ones(tmp_path, device):
    device("hwmon0", name="cpu_thermal")
    with pytest.raises(InterfaceError, match="no device is named ina226") as caught:
        hwmon.rail(tmp_path, RailDescription("ina226", hwmon="ina226"))
    assert tells(caught.value.hint, "known: cpu_thermal; ", "driver")
    with pytest.raises(InterfaceError, match="no zone has the type gpu") as caught:
        hwmon.temperature(tmp_path, TemperatureDescription("thermal", source="gpu"))
    assert caught.value.hint.startswith("known: none")


def test_files_that_are_missing_or_hold_no_number_are_named(tmp_path, device):
    device("hwmon0", name="ina226", in1_input="twelve")
    rail = RailDescription("ina226", hwmon="ina226")
    with pytest.raises(InterfaceError, match="in1_input: does not hold a number"):
        hwmon.rail(tmp_path, rail)
    with pytest.raises(InterfaceError, match="temp1_input: No such file"):
        hwmon.temperature(tmp_path, TemperatureDescription("hwmon", source="ina226"))
    with pytest.raises(InterfaceError, match="has neither fan3_input nor pwm3"):
        hwmon.fan(tmp_path, FanDescription("ina226", channel=3))


def test_a_fan_that_may_not_be_driven_is_said(tmp_path, device):
    directory = device("hwmon0", name="pwmfan")
    (directory / "pwm1").mkdir()
    with pytest.raises(InterfaceError, match="pwm1: Is a directory"):
        hwmon.set_fan(tmp_path, FanDescription("pwmfan"), 50.0)
