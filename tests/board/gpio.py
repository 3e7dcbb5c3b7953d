"""Double of gpiod for machines without GPIO: chips in a directory.

It raises what gpiod 2.5 raises for the same call.
"""

import errno
import os
import sys
from collections import deque
from enum import Enum
from pathlib import Path
from types import ModuleType, SimpleNamespace


class Value(Enum):
    INACTIVE = 0
    ACTIVE = 1


class Direction(Enum):
    AS_IS = 1
    INPUT = 2
    OUTPUT = 3


class Drive(Enum):
    PUSH_PULL = 1
    OPEN_DRAIN = 2


class Edge(Enum):
    RISING = 2
    FALLING = 3


class Clock(Enum):
    MONOTONIC = 1
    REALTIME = 2


class FakeChip:
    """A chip: labels, names of lines, who has which, and the levels at its pins.

    outside  levels that something else forces upon a line.
    changes  what was asked of the kernel, in order: (offset, direction, drive, level).
    failure  raised by the next calls.
    inputs   lines whose edges are stamped: offset -> request.
    """

    def __init__(self, label, names=(), count=58):
        self.label = label
        self.names = list(names)
        self.count = count
        self.users = {}
        self.levels = {}
        self.outside = {}
        self.changes = []
        self.failure = None
        self.inputs = {}
        self.clock = lambda: 0.0
        self.times = []

    def edge(self, offset, monotonic_ns, count=1):
        """Edges of a line, all at the same moment; of more than the kernel keeps, the newest are had."""
        self.inputs[offset].happen(monotonic_ns, count)


class Gpio:
    """The module, and the chips of a directory."""

    def __init__(self, monkeypatch, dev: Path):
        self.dev = dev
        self.chips: dict[str, FakeChip] = {}
        gpiod, line = ModuleType("gpiod"), ModuleType("gpiod.line")
        line.Value, line.Direction, line.Drive, line.Edge, line.Clock = Value, Direction, Drive, Edge, Clock
        gpiod.LineSettings = SimpleNamespace
        gpiod.line, line.__name__ = line, "gpiod.line"
        gpiod.__path__ = []
        gpiod.Chip = lambda path: _Opened(self, path)
        monkeypatch.setitem(sys.modules, "gpiod", gpiod)
        monkeypatch.setitem(sys.modules, "gpiod.line", line)

    def add(self, name, label, names=(), count=58) -> FakeChip:
        (self.dev / name).touch()
        chip = self.chips[str(self.dev / name)] = FakeChip(label, names, count)
        return chip


class _Opened:
    def __init__(self, gpio, path):
        if path not in gpio.chips:
            raise _error(errno.ENOENT)
        self._chip = gpio.chips[path]
        if self._chip.failure is not None:
            raise self._chip.failure

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def get_info(self):
        return SimpleNamespace(label=self._chip.label)

    def get_line_info(self, offset):
        return SimpleNamespace(consumer=self._chip.users.get(offset, ""))

    def line_offset_from_id(self, name):
        if name not in self._chip.names:
            raise _error(errno.ENOENT)
        return self._chip.names.index(name)

    def request_lines(self, config, consumer, event_buffer_size=None):
        ((offset, settings),) = config.items()
        if offset >= self._chip.count:
            raise ValueError("line offset of out range")
        if offset in self._chip.users:
            raise _error(errno.EBUSY)
        self._chip.users[offset] = consumer
        if settings.direction is Direction.INPUT:
            return _Input(self._chip, offset, settings, event_buffer_size)
        return _Request(self._chip, offset, settings)


class _Request:
    def __init__(self, chip, offset, settings):
        self._chip, self._offset = chip, offset
        self._configure(settings)

    def _configure(self, settings):
        self._settings = settings
        if settings.direction is Direction.OUTPUT:
            self._drive(settings.output_value, "output")
        else:
            self._chip.changes.append((self._offset, "as is", None, None))

    def _drive(self, value, what):
        if self._chip.failure is not None:
            raise self._chip.failure
        level = (value is Value.ACTIVE) != self._settings.active_low
        self._chip.levels[self._offset] = level
        self._chip.times.append((self._chip.clock(), value is Value.ACTIVE))
        self._chip.changes.append((self._offset, what, self._settings.drive, level))

    def reconfigure_lines(self, config):
        ((_, settings),) = config.items()
        self._configure(settings)

    def set_value(self, offset, value):
        self._drive(value, "set")

    def get_value(self, offset):
        if self._chip.failure is not None:
            raise self._chip.failure
        level = self._chip.outside.get(offset, self._chip.levels.get(offset, False))
        return Value(int(level != self._settings.active_low))

    def release(self):
        self._chip.users.pop(self._offset, None)


class _Input:
    """A line whose edges are stamped, with a descriptor that is ready while there are some."""

    def __init__(self, chip, offset, settings, buffer):
        self._chip, self._offset = chip, offset
        self.settings = settings
        self.fd = os.eventfd(0, os.EFD_NONBLOCK)
        self._events = deque(maxlen=buffer)
        self._sequence = 0
        chip.inputs[offset] = self

    def happen(self, monotonic_ns, count):
        assert self.settings.event_clock is Clock.MONOTONIC
        for _ in range(count):
            self._sequence += 1
            self._events.append(SimpleNamespace(line_seqno=self._sequence, timestamp_ns=monotonic_ns))
        os.eventfd_write(self.fd, 1)

    def read_edge_events(self, most):
        if self._chip.failure is not None:
            raise self._chip.failure
        if not self._events:
            raise _error(errno.EAGAIN)
        read = [self._events.popleft() for _ in range(min(most, len(self._events)))]
        if not self._events:
            os.eventfd_read(self.fd)
        return read

    def get_value(self, offset):
        assert offset == self._offset
        if self._chip.failure is not None:
            raise self._chip.failure
        return Value.INACTIVE

    def release(self):
        if self._chip.inputs.get(self._offset) is self:
            del self._chip.inputs[self._offset], self._chip.users[self._offset]
            os.close(self.fd)


def _error(number):
    return OSError(number, os.strerror(number))
