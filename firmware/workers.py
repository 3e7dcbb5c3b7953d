"""What a child process of this program can be. Each imports what it needs when it runs, and no more."""

import socket
from collections.abc import Callable, Mapping

from board import echo


def board(channel: socket.socket) -> None:
    """Does for the station what blocks: buses, chips, USB power."""
    from board.hands import serve

    serve(channel)


def simulated_board(channel: socket.socket) -> None:
    """The same, with simulated chips on its buses."""
    from drivers.sim.chips import serve_simulated

    serve_simulated(channel)


def som301e(channel: socket.socket) -> None:
    """Has the library of the radio."""
    from drivers.v2xcast import serve

    serve(channel)


def gnss_bus(channel: socket.socket) -> None:
    """Asks a receiver at an I2C bus."""
    from drivers.gnss_bus import serve

    serve(channel)


def mqtt(channel: socket.socket) -> None:
    """Is a broker's client."""
    from drivers.mqtt_client import serve

    serve(channel)


def recorder(channel: socket.socket) -> None:
    """Writes recordings."""
    from firmware.recorder.child import serve

    serve(channel)


WORKERS: Mapping[str, Callable[[socket.socket], None]] = {
    **echo.WORKERS,
    "board": board,
    "sim-board": simulated_board,
    "som301e": som301e,
    "gnss-bus": gnss_bus,
    "mqtt": mqtt,
    "recorder": recorder,
}
