"""State of a modem and its network for status; has no identifiers of card or modem."""

from collections.abc import Callable
from dataclasses import dataclass, field

from drivers.wire.at.answers import Registration, Sim
from drivers.wire.cell import Cell, Leg, Strength


@dataclass
class Known:
    """Last known state of a modem. The scripts of the driver write it, status shows it.

    registrations  registration by domain: C5GREG, CEREG, CGREG.
    system_mode    system mode reported by +CNSMOD.
    addresses      IP addresses of the bearer.
    recoveries     number of recovery actions of any kind since the station's start.
    misread        number of answers with invalid syntax.
    garbage        number of octets from the AT port that belong to no answer.
    clock          monotonic clock in seconds; constant 0 before the first start. It gives the ages of polled values:
                   `registration`, `cell` (with the signal) and `module` (temperature and operator).
    """

    clock: Callable[[], float] = lambda: 0.0
    step: str = "stopped"
    model: str = ""
    firmware: str = ""
    composition: str = ""
    sim: Sim | None = None
    pin_attempts: int | None = None
    registrations: dict[str, Registration] = field(default_factory=dict)
    system_mode: str = ""
    operator: str = ""
    cell: Cell | None = None
    rssi_dbm: int | None = None
    temperature_c: int | None = None
    device: str = ""
    addresses: tuple[str, ...] = ()
    recoveries: int = 0
    misread: int = 0
    garbage: int = 0
    _read_at: dict[str, float] = field(default_factory=dict)

    def read(self, what: str) -> None:
        """Note the current time as the time of the last answer about `registration`, `cell` or `module`."""
        self._read_at[what] = self.clock()

    @property
    def registration(self) -> Registration | None:
        """Decisive registration: a registered domain if there is one, else that of the newest radio access; or None."""
        order = [self.registrations[name] for name in ("C5GREG", "CEREG", "CGREG") if name in self.registrations]
        return next((one for one in order if one.is_registered), order[0] if order else None)

    @property
    def is_registered(self) -> bool:
        found = self.registration
        return found is not None and found.is_registered

    @property
    def registration_text(self) -> str:
        found = self.registration
        return "unknown" if found is None else found.state.name.lower().replace("_", " ")

    def forget_network(self) -> None:
        """Clear everything about the network, after the radio was switched or the modem restarted."""
        self.registrations.clear()
        self.cell = self.rssi_dbm = None
        self.operator = self.system_mode = ""

    def stop(self) -> None:
        """Clear values that only polling keeps up to date: after a stop, polling ends."""
        self.step = "stopped"
        self.temperature_c = None
        self.forget_network()

    def details(self) -> dict[str, object]:
        """Return the current state as JSON values; unknown values are left out."""
        every: dict[str, object] = {
            "step": self.step,
            "model": self.model,
            "firmware": self.firmware,
            "usb": self.composition,
            "sim": self.sim.value if self.sim else "",
            "pin_attempts": self.pin_attempts,
            "registration": self.registration_text,
            "operator": self.operator,
            "cell": _cell(self.cell) if self.cell else None,
            "rssi_dbm": self.rssi_dbm,
            "temperature_c": self.temperature_c,
            "device": self.device,
            "addresses": list(self.addresses),
            "recoveries": self.recoveries,
            "misread": self.misread,
            "garbage_octets": self.garbage,
            "age_s": self._ages(),
        }
        return {key: value for key, value in every.items() if value not in ("", None, [], {})}

    def _ages(self) -> dict[str, float]:
        """Return the age in seconds of each known polled value."""
        now = self.clock()
        known = {
            "registration": self.registrations,
            "cell": self.cell is not None or self.rssi_dbm is not None,
            "module": self.temperature_c is not None or self.operator,
        }
        return {what: round(now - then, 1) for what, then in self._read_at.items() if known[what]}


def _cell(cell: Cell) -> dict[str, object]:
    found = {key: value for key, value in cell._asdict().items() if value not in ("", None)}
    found |= {"access": cell.access.value, "strength": _strength(cell.strength)}
    if cell.leg is not None:
        found["leg"] = _leg(cell.leg)
    return {key: value for key, value in found.items() if value != {}}


def _leg(leg: Leg) -> dict[str, object]:
    found = {key: value for key, value in leg._asdict().items() if value not in ("", None)}
    return found | {"strength": _strength(leg.strength)}


def _strength(strength: Strength) -> dict[str, float]:
    return {key: value for key, value in strength._asdict().items() if value is not None}
