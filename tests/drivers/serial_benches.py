"""Benches of drivers with a serial line or a file: uart and morse."""

import os
from pathlib import Path

from drivers.contract import Driver
from drivers.morse import Morse, MorseOptions
from drivers.sim.serial_line import SerialLine
from drivers.uart import Uart, UartOptions
from drivers.wire import morse
from drivers.wire.serial_frame import Frame
from tests.drivers.bench import Bench
from tests.drivers.host import SHARED, request
from tests.virtual import VirtualLoop


class UartBench(Bench):
    """Bench with a pty behind a stable name, like those of /dev/serial/by-id."""

    patience_s = 2.0

    def __init__(self, loop: VirtualLoop, folder: Path) -> None:
        self._loop = loop
        self._path = folder / "tty"
        self.driver: Driver = Uart(UartOptions(device=str(self._path)), SHARED)

    def plug(self) -> None:
        self._line = SerialLine(self._loop)
        self._path.symlink_to(self._line.path)

    def unplug(self) -> None:
        self._path.unlink()
        self._line.unplug()

    def close(self) -> None:
        self._line.unplug()

    def say(self, pdu: bytes) -> None:
        self._line.say(request(pdu).btp_port, pdu)

    def heard(self) -> list[bytes]:
        found, self._line.heard = self._line.heard, []
        return [event.pdu for event in found if isinstance(event, Frame)]


class MorseBench(Bench):
    """Bench with two directories, one for each direction."""

    patience_s = 0.0  # no wait: a written file exists at once, and the driver checks by a timer

    def __init__(self, loop: VirtualLoop, folder: Path) -> None:
        self._speak, self._listen = folder / "speak", folder / "listen"
        self._count = 0
        self.driver: Driver = Morse(MorseOptions(speak=str(self._speak), listen=str(self._listen)), SHARED)

    def plug(self) -> None:
        self._speak.mkdir()
        self._listen.mkdir()

    def unplug(self) -> None:
        for folder in (self._speak, self._listen):
            for path in folder.iterdir():
                path.unlink()
            folder.rmdir()

    def close(self) -> None: ...

    def say(self, pdu: bytes) -> None:
        self._count += 1
        part = self._listen / "part"
        part.write_bytes(b"".join(morse.wav(morse.encode(pdu), 20)))
        os.rename(part, self._listen / f"{self._count:09}.wav")

    def heard(self) -> list[bytes]:
        found = []
        for path in sorted(self._speak.glob("*.wav")):
            ear = morse.ToneDecoder()
            ear.receive(path.read_bytes())
            pdu = morse.decode(ear.end())
            assert isinstance(pdu, bytes)
            found.append(pdu)
            path.unlink()
        return found
