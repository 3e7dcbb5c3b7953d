"""captain gnss: shows the GNSS receivers of a station, and resets them."""

import argparse
import json
from collections.abc import Mapping

from firmware.client.arguments import add_control
from firmware.client.show.status import modules
from firmware.client.show.status.modules import Kind, joined
from firmware.client.show.table import Table, counted, span
from firmware.untrusted import number, text, texts, within

DESCRIPTION = """\
Shows the GNSS receivers of a station: fix and accuracy, jamming and spoofing,
leap seconds, corrections. Or resets one of them.

A receiver is given by the name of its interface. If the station has only one,
no name is needed.
"""
EPILOG = """\
examples:
  captain gnss status
  captain gnss status --json | jq '.gnss.details.carrier'
  captain gnss reset --kind cold      forget all satellites

kinds of reset:
  hot    forget nothing; a fix follows after some seconds
  warm   forget the orbits of the last hours; fix after half a minute
  cold   forget everything, also leap seconds; complete after up to 13 minutes
  full   restart its firmware; the station configures it again

exit codes:
  0    done
  1    no station answers, or the receiver is unknown
  2    wrong usage
"""
KIND = Kind("receiver", "GNSS receiver", "technology", ("gnss",), "zed_f9p")


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("ask", choices=("status", "reset"), help="action")
    parser.add_argument("interface", nargs="?", default="", help="which receiver")
    parser.add_argument(
        "--kind", choices=("hot", "warm", "cold", "full"), default="hot", help="kind of reset (default hot)"
    )
    parser.add_argument("--json", action="store_true", help="one JSON object, by interface name")
    add_control(parser)


def main(arguments: argparse.Namespace) -> int:
    found = modules.found(arguments, KIND)
    if arguments.ask == "status":
        modules.show(found, arguments.json, table)
        return 0
    name = modules.the_only(found, KIND)
    answer = modules.operate(arguments, name, kind=arguments.kind)
    print(json.dumps({name: {"reset": answer.get("reset")}}) if arguments.json else f"{name}: {arguments.kind} reset")
    return 0


def table(name: str, one: Mapping[str, object]) -> Table:
    """Return the table of a receiver; rows without a value are omitted."""
    details = within(one, "details")
    corrections = within(details, "corrections")
    rows = [
        ("fix", _fix(details)),
        ("accuracy", _accuracy(details)),
        ("time", _time(details)),
        ("signals", _words(details, "jamming", "spoofing")),
        ("antenna", ", power ".join(filter(None, (text(details, "antenna"), text(details, "antenna_power"))))),
        ("corrections", joined(text(corrections, "source"), text(corrections, "state"))),
        ("", _frames(corrections)),
        ("receiver", _words(details, "module", "firmware", "protocol")),
        ("port", text(details, "port")),
        ("counted", _counted(details)),
    ]
    refused = texts(details, "refused")
    notes = [f"not known to its firmware: {', '.join(refused)}"] if refused else []
    return modules.rows_of(name, one, rows, notes)


def _fix(details: Mapping[str, object]) -> str:
    parts = [text(details, "fix")]
    if text(details, "carrier") not in ("", "none"):
        parts.append(f"RTK {text(details, 'carrier')}")
    if details.get("satellites") is not None:
        parts.append(f"{number(details, 'satellites'):.0f} satellites")
    if details.get("age_s") is not None:
        parts.append(f"{span(number(details, 'age_s'))} ago")
    return joined(*parts)


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
