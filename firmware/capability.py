"""What a station can tell of each thing that is declared: whether it is there, whether it works, what was measured."""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from board.errors import InterfaceError
from drivers.contract import Can
from firmware.carrier import Carrier
from firmware.place import Place
from firmware.supervisor import Supervised

UNITS = {"v": "V", "a": "A", "w": "W", "c": "C", "rpm": "rpm", "percent": "%"}
ABSENT = "see its table in the board file"
SILENT_S = 2.5  # without a pulse
TOLD = frozenset({"settling", "locked", "holdover"})  # by pulses


class Row(NamedTuple):
    """One capability.

    works   None where there is nothing that could: an empty slot that nobody uses.
    value   what was measured, in words.
    remedy  what to do where it does not work.
    ask     what a station that runs may be asked for that: a command, and what it is good for.
    """

    capability: str
    is_present: bool
    works: bool | None
    value: str
    remedy: str = ""
    ask: str = ""


def of_board(carrier: Carrier) -> Iterator[Row]:
    """Identity, rails, temperatures and fan as they were read last; hot-plug; the Pi's own lines; slots."""
    hardware = carrier.hardware
    measured: Mapping[str, Any] = carrier.health.status()
    if hardware.identity is not None:
        yield _identity(carrier)
    for table, word in (("rails", "rail"), ("temperatures", "temperature")):
        for name in getattr(hardware, table):
            yield _measured(f"{word} {name}", measured[table][name])
    if hardware.fan is not None:
        yield _measured("fan", measured["fan"])
    for name in hardware.lines:
        if name in carrier.lines:
            yield _line(carrier, name)
    if carrier.slots:
        deaf = carrier.deaf
        yield Row(
            "hot-plug", not deaf, not deaf, deaf or "uevents are heard", "run the station as root" if deaf else ""
        )
    for name, slot in carrier.listed().items():
        yield of_slot(name, slot | {"device": str(carrier.look(name) or "")})


def of_time(clock: Mapping[str, Any]) -> Iterator[Row]:
    """Pulses and time, of the status of firmware/timekeeper.py; nothing where no input is declared."""
    pulse, state = clock["pulse"], clock["state"]
    if pulse is None:
        return
    first = "first: its receiver" if pulse["is_open"] else ""
    is_heard = pulse["age_s"] is not None and pulse["age_s"] < SILENT_S
    value = f"{pulse['taken']} taken, {pulse['seconds']} good" if pulse["is_open"] else pulse["why"]
    wiring = "is the receiver's time pulse wired to this input? it gives none without satellites"
    yield Row("pulses", pulse["is_open"], is_heard, value, "" if is_heard else pulse["hint"] or wiring)
    works = state in TOLD
    bound = "" if clock["uncertainty_ns"] is None else f", within {clock['uncertainty_ns'] / 1000:.1f} us"
    why = first or "first: pulses"
    told = ("", "") if works else (why if not is_heard else "`captain time` says why pulses are refused", "")
    yield Row("time", works, works, f"{state}{bound}", *told)


def of_expander_line(name: str, outcome: object) -> Row:
    """The answer to `expander_get`."""
    if isinstance(outcome, InterfaceError):
        return Row(f"line {name}", False, False, outcome.message, outcome.hint)
    return Row(f"line {name}", True, True, _level(bool(outcome)))


def of_interface(name: str, one: Supervised, place: Place) -> Iterator[Row]:
    """Its link, and what a receiver says."""
    interface, is_up = one.interface, one.state == "up"
    first = f"first: interface {name}"  # what hangs on a link has no remedy of its own
    told = ("", "") if is_up else _of_link(one)
    yield Row(f"interface {name}", one.state in ("up", "down"), is_up, f"{one.state}: {interface.why}", *told)
    can, sky = interface.driver.capabilities.can, "does its antenna see the sky?"
    if Can.POSITION in can:
        fix = place.fix_of(name)
        value = f"{fix.kind.name.lower()}, {(fix.horizontal or 0) / 1000:.2f} m" if fix else "no fix"
        yield Row(f"position {name}", is_up, fix is not None, value, "" if fix else sky if is_up else first)
    if Can.TIMEMARK in can:
        mark = place.mark_of(name)
        works = mark is not None and mark.is_locked
        value = "none" if mark is None else f"{mark.accuracy_ns} ns, {'locked' if works else 'not locked'}"
        remedy = "" if works else first if not is_up else sky if mark else "is `pulse` on?"
        yield Row(f"time mark {name}", is_up, works, value, remedy)
    if Can.BEARER in can:
        yield _bearer(name, is_up, interface.details, first)


def _of_link(one: Supervised) -> tuple[str, str]:
    """Remedy and ask of a link that is not up: what its last failure said, or its slot does."""
    if one.hint:
        return one.hint, ""
    if one.state == "waiting" and one.interface.slot:
        return f"first: slot {one.interface.slot}", ""
    return "see `captain doctor`", "`captain status` says more"


def of_slot(name: str, slot: Mapping[str, Any]) -> Row:
    """It works when its driver runs; one that no interface has works as long as it is as it should be."""
    capability, state, device = f"slot {name}", slot["state"], slot["device"]
    is_present, is_used = bool(device), slot["interface"] is not None
    if not (is_used or is_present or state == "fault"):
        return Row(capability, False, None, "empty")
    works = state == "running" if is_used else state != "fault"
    value = f"{state}: {device or (slot['why'] if is_used else 'empty')}"
    cause = slot["cause"] or slot["why"]
    hint = f" ({slot['hint']})" if slot["hint"] else ""
    told = ("", "") if works else (f"{cause}{hint}", f"`captain slot cycle {name}` tries again")
    return Row(capability, is_present, works, value, *told)


def _bearer(name: str, is_up: bool, told: Mapping[str, Any], first: str) -> Row:
    """What carries packets has an address; how well, its signal says."""
    rssi_dbm = told.get("rssi_dbm")
    signal = "no signal" if rssi_dbm is None else f"{rssi_dbm} dBm"
    value = ", ".join([signal, *(told.get("addresses") or ["no address"])])
    works = is_up and rssi_dbm is not None
    more = ("", "") if works else ("is there a network?", "`captain modem status` says more") if is_up else (first, "")
    return Row(f"bearer {name}", is_up, works, value, *more)


def _identity(carrier: Carrier) -> Row:
    found = carrier.identity
    if found is None:
        return Row("identity", False, False, carrier.unidentified or "none", "take [identity] out of the board file")
    return Row("identity", True, True, f"{found['vendor']} {found['product']}")


def _measured(capability: str, told: Mapping[str, Any]) -> Row:
    """A reading of board/health.py."""
    values = [f"{told[key]:.4g} {unit}" for key, unit in UNITS.items() if key in told]
    if told["fault"]:
        return Row(capability, False, False, told["fault"], told["hint"] or ABSENT)
    if not values:
        return Row(
            capability, False, False, "not measured yet", "is the board's worker running?", "`captain status` says so"
        )
    crossed = told["crossed"]
    return Row(capability, True, not crossed, ", ".join([*values, *crossed]), "check the supply" if crossed else "")


def _line(carrier: Carrier, name: str) -> Row:
    """One of the Pi's own."""
    try:
        return Row(f"line {name}", True, True, _level(carrier.lines.is_active(name)))
    except InterfaceError as error:
        return Row(f"line {name}", False, False, error.message, error.hint)


def _level(is_active: bool) -> str:
    return "active" if is_active else "inactive"
