"""Console of a serial port that a module of the board uses: freed."""

from collections.abc import Mapping

from board.pi import overlays
from firmware.setup.kept import Kept
from firmware.setup.setting import Setting

UNITS = "etc/systemd/system"
WANTED = f"{UNITS}/getty.target.wants"  # links of `systemctl enable serial-getty@...`


class Console:
    """Frees serial ports from kernel messages and logins.

    folder  of cmdline.txt, below the root: boot/firmware.
    ports   serial ports by the key of the board file.
    pi      generation of the Raspberry Pi.
    """

    def __init__(self, kept: Kept, folder: str, ports: Mapping[str, str], pi: int) -> None:
        self._kept = kept
        self._command_line = f"{folder}/cmdline.txt"
        self._names = {key: overlays.console(port.removeprefix("/dev/"), pi) for key, port in ports.items()}

    def lacking(self) -> list[Setting]:
        """Return the consoles on these ports. Raises StorageError if a file cannot be read."""
        found = []
        for key, names in self._names.items():
            words = [word for word in self._words() if _console(word) in names]
            found += [Setting(f"/{self._command_line}", f"without {word.strip()}", key) for word in words]
            logins = [name for name in names if name != "serial0" and self._may_log_in(name, bool(words))]
            found += [Setting(f"/{_unit(name)}", "empty, so that no login starts", key) for name in logins]
        return found

    def make(self) -> None:
        """Remove the consoles. Raises StorageError if that fails."""
        lacking = self.lacking()
        names = {name for of_port in self._names.values() for name in of_port}
        now = self._kept.read(self._command_line) or b""
        line = now.rstrip(b"\r\n")
        after = b" ".join(word for word in line.split(b" ") if _console(word.decode("utf-8", "replace")) not in names)
        if after != line:
            self._kept.write(self._command_line, after + now[len(line) :])
        for one in lacking:
            if one.file != f"/{self._command_line}":
                self._kept.write(one.file[1:], b"")  # an empty unit is masked: systemd.unit(5)

    def _words(self) -> list[str]:
        return (self._kept.read(self._command_line) or b"").decode("utf-8", "replace").split()

    def _may_log_in(self, name: str, has_console: bool) -> bool:
        """Return whether a login starts: on a console by systemd's generator, else by a link; a masked one never."""
        unit = self._kept.root / _unit(name)
        is_masked = unit.is_symlink() or (unit.exists() and not unit.stat().st_size)
        return not is_masked and (has_console or (self._kept.root / WANTED / unit.name).is_symlink())


def _console(word: str) -> str:
    """Return the port of a word of the command line: serial0 of console=serial0,115200; empty without one."""
    key, _, value = word.partition("=")
    return value.partition(",")[0] if key == "console" else ""


def _unit(name: str) -> str:
    return f"{UNITS}/serial-getty@{name}.service"
