"""Driver for the Unex SOM301-E: ITS-G5, with GeoNetworking, BTP and security on the module.

The vendor's library communicates with the module. It is closed source, blocks and may crash, so it runs in a worker
process (process.py). If that process ends, only this interface is restarted. module.py has the state table.
"""

from typing import ClassVar

from board.runtime.errors import BlockedError, RequestError
from drivers.contract import BUSY, Can, Capabilities, Host, Sent, Shared
from drivers.message import MAX_PDU, Request
from drivers.som301e import shared_library
from drivers.som301e.module import THIS_PROGRAM, RadioHistory, RadioModule, RadioProcess
from drivers.som301e.options import Som301eOptions

METADATA = frozenset(
    ("btp_port", "rssi_dbm", "data_rate", "traffic_class", "hop_limit", "security", "position", "area", "source_mac")
)


class Som301e:
    """Driver for PDUs by the casters of a module; a caster is a service that sends and receives one BTP port."""

    Options: ClassVar[type] = Som301eOptions

    def __init__(self, options: Som301eOptions, shared: Shared, process: RadioProcess = THIS_PROGRAM) -> None:
        hears = Can.RECEIVE if any(caster.receives for caster in options.casters) else Can(0)
        self._indices = {caster.btp_port: index for index, caster in enumerate(options.casters) if caster.transmits}
        sends = Can.TRANSMIT | Can.GEOBROADCAST if self._indices else Can(0)
        self.capabilities = Capabilities(hears | sends, "its-g5", MAX_PDU, METADATA)
        self._options = options
        self._shared = shared
        self._process = process
        self._history = RadioHistory()
        self._module: RadioModule | None = None

    def start(self, host: Host) -> None:
        """Start the process with the vendor's library.

        Raises BlockedError if the library is absent or unusable. It also raises BlockedError if an earlier process
        found the library unusable and the file has not changed since. Raises InterfaceError if the process cannot be
        started.
        """
        library = shared_library.located(self._options.library)
        shared_library.check(library)
        if self._history.unusable is not None:
            identity, message, hint = self._history.unusable
            if identity == shared_library.identity(library):
                raise BlockedError(message, hint)
        self._module = RadioModule(self._options, self._shared, host, library, self._history, self._process)

    def send(self, request: Request) -> Sent:
        """Pass a PDU to the process. Raises RequestError if no caster sends to its BTP port."""
        index = self._indices.get(request.btp_port)
        if index is None:
            raise RequestError(f"no caster sends to BTP port {request.btp_port}", "name one in option casters")
        return BUSY if self._module is None else self._module.send(index, request)

    def refresh(self) -> None:
        """Ask the process for its drop count; the drops are reported to the host when the answer arrives."""
        if self._module is not None:
            self._module.refresh()

    def stop(self) -> None:
        """Stop the process without asking for its drops since the last refresh(): waiting for the answer takes time."""
        if self._module is not None:
            self._module.stop()
            self._module = None
