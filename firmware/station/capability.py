"""Capabilities of the self-test: presence, function and measured value of each part."""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from board.runtime.errors import InterfaceError
from drivers.contract import Can
from firmware.station.carrier import Carrier
from firmware.station.interface_supervisor import InterfaceSupervisor
from firmware.station.position import OwnPosition

UNITS = {"v": "V", "a": "A", "w": "W", "c": "C", "rpm": "rpm", "percent": "%"}
ABSENT = "check the part's table in the board file"
SILENT_S = 2.5  # time without a pulse after which the pulse input counts as not working
TOLD = frozenset({"settling", "locked", "holdover"})  # states of the clock with time by pulses


class Row(NamedTuple):
    """Row of the self-test: one capability.

    capability  name of the part.
    is_present  True if the part was found.
    works       True if the part works; None if it has nothing to test, as an empty slot without an interface.
    value       measured values as text.
    remedy      remedy if the part does not work.
    ask         command for a running station that shows more about the part, as a half sentence.
    """

    capability: str
    is_present: bool
    works: bool | None
    value: str
    remedy: str = ""
    ask: str = ""


def of_board(carrier: Carrier) -> Iterator[Row]:
    """Yield the rows of a board: identity, rails, temperatures, fan, lines, hot-plug and slots, with last readings."""
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
    """Yield the rows of pulses and time; none if the board has no pulse input.

    clock  status of the time, as Timekeeper.status() returns it.
    """
    pulse, state = clock["pulse"], clock["state"]
    if pulse is None:
        return
    first = "first: its receiver" if pulse["is_open"] else ""
    is_heard = pulse["age_s"] is not None and pulse["age_s"] < SILENT_S
    value = f"{pulse['taken']} taken, {pulse['seconds']} good" if pulse["is_open"] else pulse["why"]
    wiring = "wire the time pulse of the receiver to this input; it needs satellites"
    yield Row("pulses", pulse["is_open"], is_heard, value, "" if is_heard else pulse["hint"] or wiring)
    works = state in TOLD
    bound = "" if clock["uncertainty_ns"] is None else f", within {clock['uncertainty_ns'] / 1000:.1f} us"
    why = first or "first: pulses"
    told = ("", "") if works else (why if not is_heard else "`captain time` says why pulses are refused", "")
    yield Row("time", works, works, f"{state}{bound}", *told)


def of_expander_line(name: str, outcome: object) -> Row:
    """Return the row of a line of an I/O expander. outcome: its level, or the error of the question `expander_get`."""
    if isinstance(outcome, InterfaceError):
        return Row(f"line {name}", False, False, outcome.message, outcome.hint)
    return Row(f"line {name}", True, True, _level(bool(outcome)))


def of_interface(name: str, one: InterfaceSupervisor, own_position: OwnPosition) -> Iterator[Row]:
    """Yield the rows of an interface: its link, and position, time mark and bearer if its driver provides them."""
    interface, is_up = one.interface, one.state == "up"
    first = f"first: interface {name}"  # remedy of parts that depend on the link: the interface's own row has more
    told = ("", "") if is_up else _of_link(one)
    yield Row(f"interface {name}", one.is_running, is_up, f"{one.state}: {interface.why}", *told)
    can, sky = interface.driver.capabilities.can, "give its antenna a view of the sky"
    if Can.POSITION in can:
        fix = own_position.fix_of(name)
        value = f"{fix.kind.name.lower()}, {(fix.horizontal or 0) / 1000:.2f} m" if fix else "no fix"
        yield Row(f"position {name}", is_up, fix is not None, value, "" if fix else sky if is_up else first)
    if Can.TIMEMARK in can:
        mark = own_position.mark_of(name)
        works = mark is not None and mark.is_locked
        value = "none" if mark is None else f"{mark.accuracy_ns} ns, {'locked' if works else 'not locked'}"
        remedy = "" if works else first if not is_up else sky if mark else "check the option `pulse`"
        yield Row(f"time mark {name}", is_up, works, value, remedy)
    if Can.BEARER in can:
        yield _bearer(name, is_up, interface.details, first)


def _of_link(one: InterfaceSupervisor) -> tuple[str, str]:
    """Return `remedy` and `ask` of a row for a link that is not up."""
    if one.hint:
        return one.hint, ""
    if one.state == "waiting" and one.interface.slot:
        return f"first: slot {one.interface.slot}", ""
    return "see `captain doctor`", "`captain status` says more"


def of_slot(name: str, slot: Mapping[str, Any]) -> Row:
    """Return the row of a slot.

    A slot with an interface works if its driver runs. A slot without an interface works unless its state is a fault.
    """
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
    """Return the row of a bearer: signal strength and addresses. told: details that its driver reports."""
    rssi_dbm = told.get("rssi_dbm")
    signal = "no signal" if rssi_dbm is None else f"{rssi_dbm} dBm"
    value = ", ".join([signal, *(told.get("addresses") or ["no address"])])
    works = is_up and rssi_dbm is not None
    more = (
        ("", "")
        if works
        else ("check the network coverage", "`captain modem status` says more")
        if is_up
        else (first, "")
    )
    return Row(f"bearer {name}", is_up, works, value, *more)


def _identity(carrier: Carrier) -> Row:
    found = carrier.identity
    if found is None:
        return Row("identity", False, False, carrier.unidentified or "none", "remove [identity] from the board file")
    return Row("identity", True, True, f"{found['vendor']} {found['product']}")


def _measured(capability: str, told: Mapping[str, Any]) -> Row:
    """Return the row of a measurement. told: its part of the status of board.health.Health."""
    values = [f"{told[key]:.4g} {unit}" for key, unit in UNITS.items() if key in told]
    if told["fault"]:
        return Row(capability, False, False, told["fault"], told["hint"] or ABSENT)
    if not values:
        return Row(capability, False, False, "not measured yet", "check the board's worker", "`captain status` says so")
    crossed = told["crossed"]
    return Row(capability, True, not crossed, ", ".join([*values, *crossed]), "check the supply" if crossed else "")


def _line(carrier: Carrier, name: str) -> Row:
    """Return the row of a GPIO line."""
    try:
        return Row(f"line {name}", True, True, _level(carrier.lines.is_active(name)))
    except InterfaceError as error:
        return Row(f"line {name}", False, False, error.message, error.hint)


def _level(is_active: bool) -> str:
    return "active" if is_active else "inactive"
