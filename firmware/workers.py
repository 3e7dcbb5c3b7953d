"""Workers: registry of the child processes of this program, by name.

Each function imports the code of its process and returns the function that serves it. A process thus imports only its
own code, before it reports that it runs.
"""

from collections.abc import Callable, Mapping

from board.runtime import echo
from board.runtime.worker import Serve


def board() -> Serve:
    """Return the process for blocking calls of the board: buses, chips, USB power."""
    from board.bus_calls import serve

    return serve


def simulated_board() -> Serve:
    """Return the process for calls of a simulated board, whose buses have simulated chips."""
    from drivers.sim.chips import serve_simulated

    return serve_simulated


def som301e() -> Serve:
    """Return the process that runs the vendor's library of the SOM301-E radio."""
    from drivers.som301e.process import serve

    return serve


def gnss_bus() -> Serve:
    """Return the process that reads a GNSS receiver on an I2C bus."""
    from drivers.gnss.bus import serve

    return serve


def mqtt() -> Serve:
    """Return the process of an MQTT client."""
    from drivers.mqtt.client.process import serve

    return serve


def recorder() -> Serve:
    """Return the process that writes recordings."""
    from firmware.recorder.child import serve

    return serve


def facilities() -> Serve:
    """Return the process with the message library: JSON of users to octets, and back."""
    from firmware.facilities.child import serve

    return serve


def reload() -> Serve:
    """Return the process that reads captain.toml again."""
    from firmware.config.reload_child import serve

    return serve


WORKERS: Mapping[str, Callable[[], Serve]] = {
    **echo.WORKERS,
    "board": board,
    "sim-board": simulated_board,
    "som301e": som301e,
    "gnss-bus": gnss_bus,
    "mqtt": mqtt,
    "recorder": recorder,
    "facilities": facilities,
    "reload": reload,
}
