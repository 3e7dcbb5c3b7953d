"""Board section of a status as tables; missing or malformed values are omitted."""

from collections.abc import Iterator, Mapping

from firmware.client.show.table import Table, span
from firmware.untrusted import named, number, text, texts, within

UNITS = {"v": "V", "a": "A", "w": "W", "c": "C", "rpm": "rpm", "percent": "%"}


def section(status: Mapping[str, object]) -> Iterator[Table]:
    """Yield the tables of board and position: slots, measurements, complaints."""
    told = within(status, "board")
    if told:
        if within(told, "slots"):
            yield slots(told)
        complaints = [f"WRONG: {complaint}" for complaint in texts(told, "complaints")]
        yield Table(title(told), notes=[*summary(told), *complaints])
    yield from _position(within(status, "position"))


def _position(position: Mapping[str, object]) -> Iterator[Table]:
    """Yield the position, its source and accuracy as the title of a table."""
    if not text(position, "source"):
        return
    place = f"{number(position, 'latitude'):.7f} {number(position, 'longitude'):.7f}"
    words = [f"position {place} by {text(position, 'source')}"]
    if "age_s" in position:
        words.append(f"{span(number(position, 'age_s'))} ago")
    if text(position, "fix"):
        words += [
            f"fix {text(position, 'fix')}, carrier {text(position, 'carrier')}",
            f"within {number(position, 'horizontal_m'):.2f} m",
            f"{number(position, 'speed_m_s'):.1f} m/s",
        ]
    mark = within(position, "time_mark")
    if mark:
        is_locked = mark.get("is_locked") is True
        words.append(f"time within {number(mark, 'accuracy_ns'):.0f} ns, {'locked' if is_locked else 'NOT locked'}")
    yield Table(", ".join(words))


def slots(board: Mapping[str, object]) -> Table:
    """Return the table of slots, with a note for each slot that is neither running nor unused."""
    rows, notes = [], []
    for name, one in named(board, "slots"):
        rows.append(
            (
                f"{number(one, 'number'):.0f}",
                name,
                text(one, "state"),
                span(number(one, "since_s")),
                text(one, "interface"),
                f"{number(one, 'cycles'):.0f}",
                f"{text(one, 'device') or 'none':9}  {text(one, 'title')}".rstrip(),
            )
        )
        if text(one, "state") not in ("running", "unused"):
            why = text(one, "cause") if text(one, "state") == "starting" else ""
            notes.append(f"{name}: {why or text(one, 'why')}")
        if text(one, "note"):
            notes.append(f"{name}: {text(one, 'note')}")
    heads = (">slot", "name", "state", ">for", "interface", ">cycles", "device")
    return Table("slots" if rows else "no slots", heads, rows, notes)


def title(board: Mapping[str, object]) -> str:
    identity, worker = within(board, "identity"), within(board, "worker")
    known = f"{text(identity, 'vendor')} {text(identity, 'product')} {text(identity, 'product_ver')}".strip()
    runs = "" if worker.get("is_up") is True else f"; its worker does not run: {text(worker, 'why')}"
    return f"board {text(board, 'name')}: {known or text(board, 'description')}{runs}"


def measured(board: Mapping[str, object]) -> list[tuple[str, str, str, str]]:
    """Return rows of rails, temperatures and fan: kind, name, values, age in seconds."""
    rows = [("rail", name, one) for name, one in named(board, "rails")]
    rows += [("temperature", name, one) for name, one in named(board, "temperatures")]
    rows += [("fan", "", within(board, "fan"))] if within(board, "fan") else []
    return [(kind, name, values(one), f"{number(one, 'age_s'):.1f}") for kind, name, one in rows]


def summary(board: Mapping[str, object]) -> list[str]:
    """Return all measurements as short lines, one per group, for the status."""
    tables = ("rails", "temperatures")
    told = [(table, [f"{name} {values(one)}" for name, one in named(board, table)]) for table in tables]
    told += [("fan", [values(within(board, "fan"))] if within(board, "fan") else [])]
    return [f"{words}: {', '.join(found)}" for words, found in told if found]


def values(one: Mapping[str, object]) -> str:
    """Return the values of a reading with their units."""
    return " ".join(f"{number(one, key):.4g} {unit}" for key, unit in UNITS.items() if key in one) or "none"
