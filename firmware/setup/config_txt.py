"""Settings of config.txt: the file captain.txt beside it, and the line that includes it."""

from collections.abc import Mapping

from board.runtime.errors import UsageError
from firmware.setup.kept import Kept
from firmware.setup.setting import Setting

NAME = "captain.txt"
INCLUDE = f"include {NAME}"
HEAD = "# Written by `captain box setup`, which removes other lines: write yours into config.txt.\n"

_PULSE = "dtoverlay=pps-gpio"
_GPIO = "gpiopin="
# Lines with the effect of another line. Source: overlays/README of Raspberry Pi's kernel 6.12.
_SAME = {
    "dtoverlay=disable-bt": "dtoverlay=miniuart-bt",
    "dtparam=uart0=on": "dtoverlay=uart0-pi5",
    "dtparam=i2c=on": "dtparam=i2c_arm=on",
    "dtparam=i2c1=on": "dtparam=i2c_arm=on",
}


class ConfigTxt:
    """Lines that a board needs and that no other part of config.txt has.

    folder   of config.txt, below the root: boot/firmware.
    lines    lines with the key of the board file that needs each.
    filters  names of the filters below which this Pi reads lines.
    """

    def __init__(self, kept: Kept, folder: str, lines: Mapping[str, str], filters: tuple[str, ...]) -> None:
        self._kept = kept
        self._config, self._own = f"{folder}/config.txt", f"{folder}/{NAME}"
        self._lines = lines
        self._filters = filters

    def lacking(self) -> list[Setting]:
        """Return the lines that are missing.

        Raises UsageError if config.txt has another pulse, StorageError if a file cannot be read.
        """
        present = self._present()
        wanted = self._wanted(present)
        self._check_pulse(present, wanted)
        own = _settings(self._kept.read(self._own) or b"", self._filters)
        found = [Setting(f"/{self._own}", line, why) for line, why in wanted.items() if line not in own]
        found += [
            Setting(f"/{self._own}", f"without {line}", "not of this board") for line in own if line not in wanted
        ]
        if wanted and INCLUDE not in present:
            found.append(Setting(f"/{self._config}", INCLUDE, "puts its lines in force"))
        return found

    def make(self) -> None:
        """Write captain.txt, and include it. Raises StorageError if that fails."""
        present = self._present()
        lines = self._wanted(present)
        self._kept.write(self._own, (HEAD + "".join(f"{line}\n" for line in lines)).encode())
        if lines and INCLUDE not in present:
            self._kept.append(self._config, f"[all]\n{INCLUDE}\n".encode())

    def _check_pulse(self, present: list[str], wanted: Mapping[str, str]) -> None:
        """Raise UsageError if both have a pulse: the second one would be /dev/pps1."""
        ours, other = (next((line for line in many if _overlay(line) == _PULSE), "") for many in (wanted, present))
        if ours and other:
            gpio = _meaning(other).partition(_GPIO)[2].partition(",")[0]
            hint = f"change this line, or set pulse.gpio = {gpio} in a board file"
            raise UsageError(f"/{self._config}: {other} has GPIO {gpio}; the board needs {ours}", hint)

    def _wanted(self, present: list[str]) -> dict[str, str]:
        return {line: why for line, why in self._lines.items() if not any(_has(one, line) for one in present)}

    def _present(self) -> list[str]:
        return _settings(self._kept.read(self._config) or b"", self._filters)


def _settings(octets: bytes, filters: tuple[str, ...]) -> list[str]:
    """Return the lines that this Pi reads: those without a filter or below one of these.

    A comment is a line of its own: after a value, `#` is a part of the value.
    """
    found, is_read = [], True
    for text in octets.decode("utf-8", "replace").splitlines():
        line = text.strip()
        if line.startswith("[") and line.endswith("]"):
            is_read = line[1:-1].lower() in filters
        elif line and is_read and not line.startswith("#"):
            found.append(line)
    return found


def _has(present: str, wanted: str) -> bool:
    """Return True if a line has all that another one asks for."""
    name, *parameters = wanted.split(",")
    its_name, *its_parameters = _meaning(present).split(",")
    return name == its_name and set(parameters) <= set(its_parameters)


def _meaning(line: str) -> str:
    """Return the line that asks for the same in the setup's form: pps-gpio without a parameter is at GPIO 18."""
    is_default = _overlay(line) == _PULSE and _GPIO not in line
    return f"{line},{_GPIO}18" if is_default else _SAME.get(line, line)


def _overlay(line: str) -> str:
    return line.partition(",")[0]
