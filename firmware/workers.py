"""What a child process of this program can be. Each imports what it needs and no more, before it is said to run."""

from collections.abc import Callable, Mapping

from board import echo
from board.worker import Serve


def board() -> Serve:
    """Does for the station what blocks: buses, chips, USB power."""
    from board.hands import serve

    return serve


def simulated_board() -> Serve:
    """The same, with simulated chips on its buses."""
    from drivers.sim.chips import serve_simulated

    return serve_simulated


def som301e() -> Serve:
    """Has the library of the radio."""
    from drivers.v2xcast import serve

    return serve


def gnss_bus() -> Serve:
    """Asks a receiver at an I2C bus."""
    from drivers.gnss_bus import serve

    return serve


def mqtt() -> Serve:
    """Is a broker's client."""
    from drivers.mqtt_client import serve

    return serve


def recorder() -> Serve:
    """Writes recordings."""
    from firmware.recorder.child import serve

    return serve


def reload() -> Serve:
    """Reads captain.toml again."""
    from firmware.reload_child import serve

    return serve


WORKERS: Mapping[str, Callable[[], Serve]] = {
    **echo.WORKERS,
    "board": board,
    "sim-board": simulated_board,
    "som301e": som301e,
    "gnss-bus": gnss_bus,
    "mqtt": mqtt,
    "recorder": recorder,
    "reload": reload,
}
