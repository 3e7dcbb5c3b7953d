"""What is known of a modem and its network: what status shows. Nothing in it says whose it is."""

from collections.abc import Callable
from dataclasses import dataclass, field

from drivers.wire.cell import Cell, Leg, Strength
from drivers.wire.modem_answers import Registration, Sim


@dataclass
class Known:
    """Filled by the steps, read by who shows it.

    registrations  by domain.
    system_mode    of +CNSMOD.
    addresses      of the bearer.
    recoveries     resets of any kind since the start of the station.
    misread        answers that were none of the syntax.
    clock          monotonic seconds, once there is a loop; for the ages of what the modem says again and again:
                   its `registration`, its `cell` with the signal, the `module` with temperature and operator.
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
        """It has just said this."""
        self._read_at[what] = self.clock()

    @property
    def registration(self) -> Registration | None:
        """The one that counts: any that carries packets, else the newest access that says something."""
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
        """The radio was switched, or the modem started again."""
        self.registrations.clear()
        self.cell = self.rssi_dbm = None
        self.operator = self.system_mode = ""

    def stop(self) -> None:
        """Nobody asks any more: what would only grow older is forgotten."""
        self.step = "stopped"
        self.temperature_c = None
        self.forget_network()

    def details(self) -> dict[str, object]:
        """As JSON of now; what is not known is left out."""
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
        """Of what is known."""
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
