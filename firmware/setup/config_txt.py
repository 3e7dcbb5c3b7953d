"""Settings of config.txt: the file captain.txt beside it, and the line that includes it."""

from collections.abc import Mapping

from firmware.setup.kept import Kept
from firmware.setup.setting import Setting

NAME = "captain.txt"
INCLUDE = f"include {NAME}"
HEAD = "# Written by `captain box setup`, which removes other lines: write yours into config.txt.\n"


class ConfigTxt:
    """Lines that a board needs and that no other part of config.txt has.

    folder  of config.txt, below the root: boot/firmware.
    lines   lines with the key of the board file that needs each.
    pi      generation of the Raspberry Pi.
    """

    def __init__(self, kept: Kept, folder: str, lines: Mapping[str, str], pi: int) -> None:
        self._kept = kept
        self._config, self._own = f"{folder}/config.txt", f"{folder}/{NAME}"
        self._lines = lines
        self._filters = ("all", f"pi{pi}")

    def lacking(self) -> list[Setting]:
        """Return the lines that are missing. Raises StorageError if a file cannot be read."""
        present = self._present()
        wanted = {line: why for line, why in self._lines.items() if not any(_has(one, line) for one in present)}
        own = _settings(self._kept.read(self._own) or b"", self._filters)
        found = [Setting(f"/{self._own}", line, why) for line, why in wanted.items() if line not in own]
        found += [
            Setting(f"/{self._own}", f"without {line}", "not of this board") for line in own if line not in wanted
        ]
        if wanted and INCLUDE not in present:
            found.append(Setting(f"/{self._config}", INCLUDE, "puts its lines in force"))
        return found

    def make(self, kept: Kept) -> None:
        """Write captain.txt, and include it. Raises StorageError if that fails."""
        present = self._present()
        lines = [line for line in self._lines if not any(_has(one, line) for one in present)]
        kept.write(self._own, (HEAD + "".join(f"{line}\n" for line in lines)).encode())
        if lines and INCLUDE not in present:
            config = kept.read(self._config) or b""
            end = b"" if config.endswith(b"\n") or not config else b"\n"
            kept.write(self._config, config + end + f"[all]\n{INCLUDE}\n".encode())

    def _present(self) -> list[str]:
        return _settings(self._kept.read(self._config) or b"", self._filters)


def _settings(octets: bytes, filters: tuple[str, ...]) -> list[str]:
    """Return the lines that this Pi reads: those without a filter or below one of these; without comments."""
    found, is_read = [], True
    for text in octets.decode("utf-8", "replace").splitlines():
        line = text.partition("#")[0].strip()
        if line.startswith("[") and line.endswith("]"):
            is_read = line[1:-1].lower() in filters
        elif line and is_read:
            found.append(line)
    return found


def _has(present: str, wanted: str) -> bool:
    """Return True if a line has all that another one asks for: a second overlay pps-gpio would make /dev/pps1."""
    name, *parameters = wanted.split(",")
    its_name, *its_parameters = present.split(",")
    return name == its_name and set(parameters) <= set(its_parameters)
