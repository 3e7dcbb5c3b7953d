"""captain gnss: what the GNSS receivers of a station see, and their reset."""

import argparse
import json
from collections.abc import Mapping

from board.errors import StationError
from firmware.user import client
from firmware.user.arguments import add_control, address
from firmware.user.table import Screen, Table, counted, span
from firmware.user.untrusted import named, number, text, texts, within

DESCRIPTION = """\
Shows what the GNSS receivers of a station see: the fix and how good it is,
jamming and spoofing, leap seconds, corrections; or resets one.

A receiver is given by the name of its interface; a station with one receiver
needs no name.
"""
EPILOG = """\
examples:
  captain gnss status
  captain gnss status --json | jq '.gnss.details.carrier'
  captain gnss reset --kind cold      as if it had never seen a satellite

kinds of reset:
  hot    it forgets nothing: a fix follows after some seconds
  warm   it forgets the orbits of the last hours: half a minute
  cold   it forgets everything, also leap seconds: up to 13 minutes
  full   its software starts anew; the station configures it again

exit codes:
  0    done
  1    no station answers, or it has no such receiver
  2    wrong usage
"""
TECHNOLOGY = "gnss"


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("ask", choices=("status", "reset"), help="what to do")
    parser.add_argument("interface", nargs="?", default="", help="which receiver")
    parser.add_argument("--kind", choices=("hot", "warm", "cold", "full"), default="hot", help="of reset (default hot)")
    parser.add_argument("--json", action="store_true", help="one JSON object, by the names of the interfaces")
    add_control(parser)


def main(arguments: argparse.Namespace) -> int:
    found = _receivers(arguments)
    if arguments.ask == "status":
        if arguments.json:
            print(json.dumps(found))
        else:
            Screen().show([table(name, one) for name, one in found.items()])
        return 0
    if len(found) > 1:
        raise StationError(f"the station has {len(found)} receivers", f"name one of {', '.join(found)}")
    name = next(iter(found))
    answer = client.ask_local(
        address(arguments),
        arguments.control,
        "operate",
        interface=name,
        ask="reset",
        arguments={"kind": arguments.kind},
    )
    print(json.dumps({name: {"reset": answer.get("reset")}}) if arguments.json else f"{name}: {arguments.kind} reset")
    return 0


def _receivers(arguments: argparse.Namespace) -> dict[str, dict[str, object]]:
    """The interfaces that are receivers, or the one that is asked for. Raises StationError where there is none."""
    status = client.status(address(arguments), arguments.control)
    found = {name: one for name, one in named(status, "interfaces") if text(one, "technology") == TECHNOLOGY}
    if not found:
        raise StationError("the station has no GNSS receiver", 'captain.toml: an interface with driver = "zed_f9p"')
    if not arguments.interface:
        return found
    if arguments.interface not in found:
        raise StationError(f"the station has no receiver {arguments.interface!r}", f"it has {', '.join(found)}")
    return {arguments.interface: found[arguments.interface]}


def table(name: str, one: Mapping[str, object]) -> Table:
    """What a receiver says of itself; a row that it says nothing about is left out."""
    details = within(one, "details")
    corrections = within(details, "corrections")
    rows = [
        ("fix", _fix(details)),
        ("accuracy", _accuracy(details)),
        ("time", _time(details)),
        ("signals", _words(details, "jamming", "spoofing")),
        ("antenna", ", power ".join(filter(None, (text(details, "antenna"), text(details, "antenna_power"))))),
        ("corrections", ", ".join(filter(None, (text(corrections, "source"), text(corrections, "state"))))),
        ("", _frames(corrections)),
        ("receiver", _words(details, "module", "firmware", "protocol")),
        ("port", text(details, "port")),
        ("counted", _counted(details)),
    ]
    refused = texts(details, "refused")
    notes = [f"not known to its firmware: {', '.join(refused)}"] if refused else []
    state = f"{text(one, 'state')} for {span(number(one, 'since_s'))}"
    return Table(f"{name}: {state}: {text(one, 'why')}", ("what", "value"), [row for row in rows if row[1]], notes)


def _fix(details: Mapping[str, object]) -> str:
    parts = [text(details, "fix")]
    if text(details, "carrier") not in ("", "none"):
        parts.append(f"RTK {text(details, 'carrier')}")
    if details.get("satellites") is not None:
        parts.append(f"{number(details, 'satellites'):.0f} satellites")
    if details.get("age_s") is not None:
        parts.append(f"{span(number(details, 'age_s'))} ago")
    return ", ".join(filter(None, parts))


def _accuracy(details: Mapping[str, object]) -> str:
    return ", ".join(
        f"{number(details, f'{way}_mm') / 1000:.3f} m {way}"
        for way in ("horizontal", "vertical")
        if details.get(f"{way}_mm") is not None
    )


def _time(details: Mapping[str, object]) -> str:
    if "leap_source" not in details:
        return ""
    if details.get("leap_seconds") is None:
        return "leap seconds are not known yet: no UTC"
    known = f"{number(details, 'leap_seconds'):.0f} leap seconds from {text(details, 'leap_source')}"
    change = within(details, "leap_change")
    announced = f", {number(change, 'seconds'):+.0f} at Unix time {number(change, 'unix'):.0f}" if change else ""
    return known + announced + ("" if details.get("utc_resolved") is True else ", UTC not resolved")


def _words(details: Mapping[str, object], *keys: str) -> str:
    return ", ".join(f"{key.replace('_', ' ')} {text(details, key)}" for key in keys if text(details, key))


def _frames(corrections: Mapping[str, object]) -> str:
    if not corrections:
        return ""
    parts = [f"{number(corrections, 'frames'):.0f} frames"]
    if corrections.get("age_s_below") is not None:
        parts.append(f"younger than {number(corrections, 'age_s_below'):.0f} s")
    parts += [f"{number(corrections, key):.0f} {key}" for key in ("used", "unused", "damaged") if key in corrections]
    return ", ".join(parts)


def _counted(details: Mapping[str, object]) -> str:
    counts = ("jumps", "withheld", "garbage_octets", "bringups")
    return counted((number(details, key), key.replace("_", " ")) for key in counts)
