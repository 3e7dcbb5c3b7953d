"""A board with one of everything, and a machine of directories for it."""

from pathlib import Path

from board.description import (
    BusDescription,
    ChipDescription,
    FanDescription,
    Hardware,
    IdentityDescription,
    LineDescription,
    RailDescription,
    SlotDescription,
    TemperatureDescription,
)
from board.machine import Machine

BOARD = Hardware(
    name="everything",
    simulated=True,
    buses={"main": BusDescription("/dev/i2c-1"), "id": BusDescription("/dev/i2c-0")},
    lines={
        "radio": LineDescription(chip="pinctrl-bcm2711", offset=5),
        "modem": LineDescription(expander="slots", pin=3, active_low=True),
        "modem_reset": LineDescription(expander="slots", pin=12, active_low=True, open_drain=True),
    },
    expanders={"slots": ChipDescription("main", 0x20)},
    rails={
        "main": RailDescription("ina226", "main", 0x40, min_v=11.4, max_v=12.6, max_a=4.0),
        "modem": RailDescription("ina3221", "main", 0x41, channel=2, max_v=3.6),
        "pi": RailDescription("ina219", hwmon="ina219"),
    },
    temperatures={
        "board": TemperatureDescription("tmp102", "main", 0x48, max_c=70.0),
        "cpu": TemperatureDescription("thermal", source="cpu-thermal"),
    },
    fan=FanDescription("pwmfan"),
    identity=IdentityDescription("id", 0x50),
    slots={"modem": SlotDescription(power="modem", reset="modem_reset", ids=("1e0e:9001",))},
)


def make_machine(root: Path) -> Machine:
    """The files that the kernel would have for it."""
    files = {
        "sys/class/hwmon/hwmon0/name": "pwmfan",
        "sys/class/hwmon/hwmon0/pwm1": "128",
        "sys/class/hwmon/hwmon0/fan1_input": "4200",
        "sys/class/hwmon/hwmon1/name": "ina219",
        "sys/class/hwmon/hwmon1/in1_input": "5100",
        "sys/class/hwmon/hwmon1/curr1_input": "700",
        "sys/class/thermal/thermal_zone0/type": "cpu-thermal",
        "sys/class/thermal/thermal_zone0/temp": "48000",
        "sys/bus/usb/devices/1-1.3/authorized": "1",
        "sys/bus/usb/devices/1-1.3/busnum": "1",
        "sys/bus/usb/devices/1-1.3/devnum": "4",
        "sys/bus/usb/devices/1-1:1.0/1-1-port3/disable": "0",
        "proc/device-tree/hat/vendor": "Firmware\0",
        "proc/device-tree/hat/product": "Quad\0",
    }
    for name, text in files.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    (root / "dev").mkdir(exist_ok=True)
    return Machine(root / "sys", root / "dev", root / "proc")
