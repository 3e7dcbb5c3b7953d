"""Driver for MQTT: messages by a broker, for example over a mobile network.

The client runs in a worker process (client/process.py), because name look-ups, TCP and TLS block, and a broker may send
without end. While the broker is unreachable, messages wait in the station's queue, with priorities and lifetimes.
"""

from collections.abc import Sequence
from typing import ClassVar

from board.runtime.errors import BlockedError
from drivers.contract import BUSY, Can, Capabilities, Host, Sent, Shared
from drivers.message import MAX_PDU, Request
from drivers.mqtt.broker import broker
from drivers.mqtt.options import MqttOptions, check_files, file_stamps
from drivers.mqtt.uplink import ClientHistory, Uplink

METADATA = frozenset(("btp_port", "source"))

# Longest wait at the station's end for the process to send its last messages and DISCONNECT; enough for a mobile
# network.
PART_S = 0.4

# Seconds without a message after which the process counts as frozen, by a debugger or the kernel. A running process
# sends a message every second.
SILENCE_S = 5.0


class Mqtt:
    """Driver for PDUs by a broker.

    command    command line of the process with the client, for Worker; empty: this program.
    silence_s  seconds without a message after which the process counts as frozen.
    """

    Options: ClassVar[type] = MqttOptions

    def __init__(
        self, options: MqttOptions, shared: Shared, command: Sequence[str] = (), silence_s: float = SILENCE_S
    ) -> None:
        can = Can.RECEIVE | Can.TRANSMIT | Can.ANYWHERE
        self.capabilities = Capabilities(can, "mqtt", MAX_PDU, METADATA, broker(options.url).place)
        self.bearer = options.bearer
        self._options = options
        self._shared = shared
        self._command = command
        self._silence_s = silence_s
        self._history = ClientHistory()
        self._uplink: Uplink | None = None

    def start(self, host: Host) -> None:
        """Start the process with the client, as soon as the clock is set.

        Raises BlockedError if a file of the options cannot be used. It also raises BlockedError if an earlier process
        found a file unusable and no file has changed since. Raises InterfaceError if the process cannot be started.
        """
        check_files(self._options)
        stamps = file_stamps(self._options)
        if self._history.unusable is not None:
            before, message, hint = self._history.unusable
            if before == stamps:
                raise BlockedError(message, hint)
        self._history.stamps = stamps
        self._uplink = Uplink(self._options, self._shared, host, self._history, self._command, self._silence_s)
        self._uplink.start()

    def send(self, request: Request) -> Sent:
        return BUSY if self._uplink is None else self._uplink.send(request)

    def refresh(self) -> None:
        """Do nothing: the process with the MQTT client reports its drops without being asked."""

    def stop(self) -> None:
        """Stop the process without waiting; it still disconnects from the broker."""
        if self._uplink is not None:
            self._uplink.stop()
            self._uplink = None

    def part(self) -> None:
        if self._history.parting is not None:
            self._history.parting.finish(PART_S)

    def bearer_changed(self, state: str, device: str, why: str) -> None:
        if self._uplink is not None:
            self._uplink.bearer_changed(state, device, why)
