"""Options of an interface with a SOM301-E."""

from collections import Counter
from dataclasses import dataclass
from typing import Annotated

from board.runtime.address import is_ipv4
from board.runtime.describe import Range
from board.runtime.errors import ConfigurationError
from drivers.som301e.handlers import MODES, WORDS, Caster

# The module answers about 30 s after power-on, and later after an update of its firmware.
SILENT_S = 120.0

# Casters of the vehicleCAPTAIN profile: CAM, DENM, MAPEM, SPATEM, IVIM, CPM, RTCMEM, VAM, with BTP ports of TS 103 248.
VEHICLE_CAPTAIN = tuple(
    Caster(caster_id, port) for caster_id, port in enumerate((2001, 2002, 2003, 2004, 2006, 2009, 2013, 2018))
)


@dataclass(frozen=True)
class Som301eOptions:
    """Unex SOM301-E, by the vendor's library.

    library   path of the vendor's libeu_v2xcast.so, which you install. Its name alone: in lib/ beside captain.toml,
              /usr/local/lib or /usr/lib.
    ip        address of the module. Some module images have another than the default.
    casters   services of the module that are used: `[{ caster_id = 0, btp_port = 2001, mode = "both" }]`.
    silent_s  a module in a slot is power-cycled after this time without a working handler.

    Raises ConfigurationError if ip is not an IPv4 address, or if casters is empty. It also raises it if two casters
    have the same caster_id and direction, or send to the same BTP port.
    """

    library: str
    ip: str = "192.168.1.3"
    casters: tuple[Caster, ...] = VEHICLE_CAPTAIN
    silent_s: Annotated[float, Range(60.0, 86_400.0)] = SILENT_S

    def __post_init__(self) -> None:
        if not is_ipv4(self.ip):
            raise ConfigurationError(f'ip: invalid IPv4 address: "{self.ip}"', "write for example 192.168.1.3")
        if not self.casters:
            raise ConfigurationError("casters: empty list", "leave the option out for the default casters")
        handlers = Counter((caster.caster_id, mode) for caster in self.casters for mode in MODES[caster.mode])
        for (caster_id, mode), count in handlers.items():
            if count > 1:
                raise ConfigurationError(f"casters: caster_id {caster_id} is used for {WORDS[mode]} {count} times")
        senders = Counter(caster.btp_port for caster in self.casters if caster.transmits)
        for port, count in senders.items():
            if count > 1:
                raise ConfigurationError(f"casters: {count} of them send to BTP port {port}", "let one do so")
